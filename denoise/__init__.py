"""Denoisers written in Dr.Jit, the scores of their results, and the report.

Knows frames (`onespp.render.frame`) and their folders (`onespp.render.files.sequence`), not scenes
and not Mitsuba. Importing this package loads neither Dr.Jit nor LLVM.
"""

import onespp.render  # noqa: F401  (has LLVM found before anything imports Dr.Jit)
