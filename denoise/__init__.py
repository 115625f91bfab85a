"""Denoisers written in Dr.Jit, the scores of their results, and the report.

Knows frames (`render.frame`) and their folders (`render.sequence`), not scenes and not Mitsuba.
"""

import render as _render  # noqa: F401  (has LLVM found before anything imports Dr.Jit)
