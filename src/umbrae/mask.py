"""The answer: which samples lie in shadow."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


class Guarantee(enum.StrEnum):
    """How a method's verdicts relate to the truth."""

    EXACT = "exact"
    """No verdict differs from exact arithmetic."""
    BANDED = "banded"
    """No verdict differs outside a derived distance from the nearest face of any shadow volume."""
    NONE = "none"
    """Nothing is promised."""


@dataclass(frozen=True, eq=False)
class ShadowMask:
    """The verdict for every view sample of one light.

    Attributes
    ----------
    in_shadow
        `(...) bool`, the samples' shape: true where no light arrives, of any colour. Background is lit.
    guarantee
        What the method promises about it.
    band
        `(...) float32` world units, for `BANDED`: verdicts of samples nearer than this to a face of a shadow volume,
        other than the cap that their own triangle is, may differ.
    inner_faces
        Whether sides between neighbouring triangles are faces as well: for a method that gives every triangle a volume
        of its own, and does not make opposite sides cancel to the last bit.
    stats
        Work counters, whole numbers by name; memory at its most, in names that end in "_bytes".
    partial
        `(..., 3) float32` in [0, 1]: the share of light that arrives per colour channel, where casters let some of it
        through or the light has a size; None where every sample is either lit or dark.
    tolerance
        The most that an entry of `partial` may be off.
    """

    in_shadow: NDArray[np.bool_]
    guarantee: Guarantee
    band: NDArray[np.float32] | None = None
    inner_faces: bool = False
    stats: Mapping[str, int] = field(default_factory=dict)
    partial: NDArray[np.float32] | None = None
    tolerance: float = 0.0

    @cached_property
    def transmittance(self) -> NDArray[np.float32]:
        """`(..., 3) float32`, the share of light that arrives per colour channel: 1 lit, 0 dark."""
        if self.partial is not None:
            return self.partial
        lit = np.where(self.in_shadow, np.float32(0), np.float32(1))
        return np.repeat(lit[..., None], 3, axis=-1)


def add_stats(total: dict[str, int], more: Mapping[str, int]) -> None:
    """Add another mask's counters to `total`; memory is used again, so the larger counts."""
    for name, value in more.items():
        before = total.get(name, 0)
        total[name] = max(before, value) if name.endswith("_bytes") else before + value
