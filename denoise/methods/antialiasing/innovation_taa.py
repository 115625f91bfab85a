"""Our filter, then temporal anti-aliasing: the whole chain of a real-time renderer.

`onespp` takes the noise out of each jittered frame, `taa` makes one image of their edges. SVGF's
published pipeline ends in the same way (Schied et al. 2017, doi:10.1145/3105762.3105770).

Departures: those of the two stages.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from onespp.denoise.history.records import RecordState
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.methods.filtered_innovation.passes import Passes

from ..assignment import Filtered
from .taa import Taa, TaaState


@dataclass(frozen=True)
class InnovationTaa(Filtered[RecordState[Passes], TaaState]):
    """`onespp`, then temporal anti-aliasing, of jittered frames.

    Attributes:
        filter: the first stage, a `FilteredInnovation`.
        history: the second stage, a `Taa`.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = InnovationTaa(history=Taa(alpha=0.1))
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    filter: FilteredInnovation = field(default_factory=FilteredInnovation)
    history: Taa = field(default_factory=Taa)

    uses: ClassVar[tuple[str, ...]] = FilteredInnovation.uses
