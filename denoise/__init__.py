"""Denoisers written in Dr.Jit, the scores of their results, and the report.

Knows frames (`onespp.render.frame`) and their folders (`onespp.render.files.sequence`), not scenes and not Mitsuba.
"""

import onespp.render as _render
