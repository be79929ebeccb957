"""What glass mirrors instead of letting it through."""

from umbrae.geometry.vectors import Vec3, dot
from umbrae.parallel import inline

_HEAD_ON = 0.04
"""Share that glass of refractive index 1.5 mirrors when looked at squarely."""


@inline
def mirrored(normal: Vec3, to_eye: Vec3) -> float:
    """Share of light that glass mirrors, by the angle between two unit vectors; from either side (Schlick 1994)."""
    aslant: float = max(0.0, 1.0 - abs(dot(normal, to_eye)))
    return _HEAD_ON + (1.0 - _HEAD_ON) * aslant**5
