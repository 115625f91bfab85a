"""Mitsuba with its variant set. Renderer modules take `mi` from here, so that it always is.

The variant follows `backend.choose()`; set ONESPP_DEVICE to override it. A variant that the
program set itself is kept if it will do.
"""

from __future__ import annotations

from typing import Any

import mitsuba

from onespp.render.errors import InputError
from onespp.render.host import backend

mi: Any = mitsuba  # its stubs describe no variant in particular


def check_variant() -> None:
    """InputError where the program, or a scene's file, set a variant that renders nothing here."""
    if mi.variant() not in backend.VARIANTS.values():
        raise InputError(f"the Mitsuba variant is {mi.variant()}: leave out mitsuba.set_variant, "
                         f"or set {' or '.join(backend.VARIANTS.values())}")


if mi.variant() is None:
    mi.set_variant(backend.VARIANTS[backend.choose()])
check_variant()

__all__ = ["check_variant", "mi"]
