"""Mitsuba with its variant set. Renderer modules take `mi` from here, so that it always is.

The variant follows `backend.choose()`; set ONESPP_DEVICE to override it. A variant that the
program set itself is kept if it will do.
"""

from __future__ import annotations

from typing import Any

import mitsuba

from onespp.render.errors import InputError
from onespp.render.host import backend

VARIANTS = {"llvm": "llvm_ad_rgb", "cuda": "cuda_ad_rgb"}

mi: Any = mitsuba  # its stubs describe no variant in particular

if mi.variant() is None:
    mi.set_variant(VARIANTS[backend.choose()])
elif mi.variant() not in VARIANTS.values():
    raise InputError(f"the Mitsuba variant is {mi.variant()}: use {' or '.join(VARIANTS.values())}")

__all__ = ["mi"]
