"""The recurrent autoencoder, fed with frames that `onespp` has accumulated.

    onespp denoise DIR --method docs/examples/accumulated_rae.py --set weights=FILE

FILE is what `onespp train rae --result accumulated` wrote: see "Controls of what is learned" in the
page of the methods.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from onespp.denoise.methods.assignment import Filtered
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.methods.learned.rae import Rae

_NONE = 1e-6  # standard deviations: the last filter takes nothing from other pixels


@dataclass(frozen=True)
class AccumulatedRae(Filtered):
    """`onespp` without its last filter, then the network."""

    filter: FilteredInnovation = field(default_factory=lambda: FilteredInnovation(
        light_sigma=_NONE, texture_sigma=_NONE, visibility_sigma=_NONE, mirror_sigma=_NONE))
    history: Rae = field(default_factory=Rae)

    uses = FilteredInnovation.uses
