"""Frames: path traced at one sample per pixel, their references, and the files they live in.

Importing this package imports neither Mitsuba nor Dr.Jit and loads no LLVM, so that frames can be
read, scored and shown without. An LLVM is looked for when Dr.Jit or Mitsuba is first imported,
by whoever it is, for Dr.Jit loads one at its import (see `render/host/backend.py`).
"""

from .host import backend as _backend

_backend.prepare_before_drjit()
