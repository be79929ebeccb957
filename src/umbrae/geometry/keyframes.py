"""Values over time, as glTF 2.0 interpolates between keyframes (its appendix C)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LINEAR, STEP, CUBIC = "LINEAR", "STEP", "CUBICSPLINE"

_NEAR = 0.9995
"""Cosine of the angle below which an arc is as good as its chord, and dividing by its sine is not."""


class Keyframes(NamedTuple):
    """A value of `w` numbers at each of some moments.

    Attributes
    ----------
    times
        `(k,)` seconds, ascending, at least one.
    values
        `(k, w)`; for `CUBICSPLINE` `(k, 3, w)`: the slope before each, the value, the slope after, per second.
    interpolation
        `LINEAR` (along the shorter arc where values are rotations), `STEP` or `CUBICSPLINE`.
    rotates
        Whether values are quaternions.
    """

    times: Floats
    values: Floats
    interpolation: str
    rotates: bool

    def at(self, seconds: float) -> Floats:
        """`(w,)` the value at a moment; the first or last one beyond them."""
        last = len(self.times) - 1
        after = int(np.searchsorted(self.times, seconds, side="right"))
        before, after = max(after - 1, 0), min(after, last)
        span = self.times[after] - self.times[before]
        share = float((seconds - self.times[before]) / span) if span > 0 else 0.0
        if self.interpolation == CUBIC:
            first, second = self.values[before], self.values[after]
            return self._whole(_spline(first[1], first[2] * span, second[1], second[0] * span, share))
        first, second = self.values[before], self.values[after]
        if self.interpolation == STEP:
            held: Floats = first
            return held
        if self.rotates:
            return _slerp(self._whole(first), self._whole(second), share)
        blended: Floats = first + share * (second - first)
        return blended

    def _whole(self, value: Floats) -> Floats:
        """A quaternion of length 1; other values as they are."""
        length = float(np.linalg.norm(value)) if self.rotates else 0.0
        return value / length if length > 0 else value


def _spline(p: Floats, slope_p: Floats, q: Floats, slope_q: Floats, t: float) -> Floats:
    """Hermite's cubic from p to q."""
    square, cube = t * t, t * t * t
    point: Floats = (
        (2 * cube - 3 * square + 1) * p
        + (cube - 2 * square + t) * slope_p
        + (3 * square - 2 * cube) * q
        + (cube - square) * slope_q
    )
    return point


def _slerp(p: Floats, q: Floats, t: float) -> Floats:
    """Between two quaternions of length 1 along the shorter arc."""
    cosine = float(p @ q)
    if cosine < 0:
        q, cosine = -q, -cosine
    if cosine > _NEAR:
        chord: Floats = p + t * (q - p)
        return chord
    angle = np.arccos(cosine)
    point: Floats = (np.sin((1 - t) * angle) * p + np.sin(t * angle) * q) / np.sin(angle)
    return point
