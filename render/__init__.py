"""Frames: path traced at one sample per pixel, their references, and the files they live in.

Importing this package finds LLVM (see `render/backend.py`) but imports neither Mitsuba nor
Dr.Jit, so that `denoise` can read frames without a renderer.
"""

from . import backend as _backend

_backend.prepare()
