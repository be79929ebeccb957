"""Cubic Hermite curves between points with normals, many at a time (Mattausch et al. 2012, section 3.2, Equation 1)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float64]

MOST_PIECES = 64
"""Of one curve: even where an edge turns by a right angle, 64 chords look smooth."""

BLEND = 0.5
"""How far Phong's curves go from their chords: this puts the middle of a circle's arc on it, up to a fourth order."""


class Curves(NamedTuple):
    """Cubic curves, one per row: their ends `p0, p1 (k, 3) float64`, and the derivatives there, `t0, t1 (k, 3)`."""

    p0: Rows
    p1: Rows
    t0: Rows
    t1: Rows

    def take(self, chosen: NDArray[np.intp]) -> "Curves":
        """Some of them, or some several times."""
        return Curves(*(part[chosen] for part in self))

    def at(self, u: Rows) -> Rows:
        """Points at `u (k,)` in [0, 1] (Equation 1), exactly the ends at 0 and at 1."""
        p0, p1, t0, t1 = self
        v = u[:, None]
        w = 1.0 - v
        return w * w * ((1.0 + 2.0 * v) * p0 + v * t0) + v * v * ((1.0 + 2.0 * w) * p1 - w * t1)

    def derivative(self, u: Rows) -> Rows:
        """Derivatives at `u (k,)`."""
        p0, p1, t0, t1 = self
        v = u[:, None]
        w = 1.0 - v
        return 6.0 * v * w * (p1 - p0) + w * (1.0 - 3.0 * v) * t0 + v * (1.0 - 3.0 * w) * t1

    def between(self, start: Rows, stop: Rows) -> "Curves":
        """Their parts from `start (k,)` to `stop (k,)`."""
        length = (stop - start)[:, None]
        return Curves(self.at(start), self.at(stop), self.derivative(start) * length, self.derivative(stop) * length)

    def chords(self, epsilon: Rows) -> NDArray[np.int64]:
        """`(k,)` into how many chords to cut each so that none is farther than `epsilon (k,)` from its arc.

        The second derivative of a cubic is linear, so it is largest at an end; an arc over 1/n of the parameter is at
        most an eighth of that, divided by n squared, from its chord. Section 3.3 halves until Equation 2 holds, which
        measures the same at the middle alone. At most `MOST_PIECES`.
        """
        p0, p1, t0, t1 = self
        at_start, at_end = 6 * (p1 - p0) - 4 * t0 - 2 * t1, 2 * t0 + 4 * t1 - 6 * (p1 - p0)
        bend = np.maximum(np.linalg.norm(at_start, axis=1), np.linalg.norm(at_end, axis=1))
        with np.errstate(divide="ignore", invalid="ignore"):
            count = np.nan_to_num(np.ceil(np.sqrt(bend / (8 * epsilon))), nan=1.0, posinf=MOST_PIECES)
        pieces: NDArray[np.int64] = np.clip(count, 1, MOST_PIECES).astype(np.int64)
        return pieces


def dots(a: Rows, b: Rows) -> Rows:
    """`(k,)` scalar products of rows."""
    product: Rows = np.einsum("ij,ij->i", a, b)
    return product


def units(a: Rows) -> Rows:
    """Rows of length 1; rows of zeros stay."""
    length = np.linalg.norm(a, axis=1, keepdims=True)
    unit: Rows = np.divide(a, length, out=np.zeros_like(a), where=length > 0)
    return unit


def along_surface(chord: Rows, normal: Rows) -> Rows:
    """Unit directions of chords projected onto the planes of unit normals; the chord's own where nothing is left."""
    flat = units(chord - dots(normal, chord)[:, None] * normal)
    return np.where(dots(flat, chord)[:, None] > 0, flat, units(chord))


def curved(p0: Rows, p1: Rows, first: Rows, last: Rows) -> Curves:
    """Curves between points with these unit directions at the ends, that turn as an arc over the chord would.

    Their derivatives are as long as that arc: |e| (theta / 2) / sin(theta / 2) for directions that turn by theta (Wang
    et al. 2008).
    """
    half = np.arccos(np.clip(dots(first, last), -1.0, 1.0)) / 2
    longer = np.divide(half, np.sin(half), out=np.ones_like(half), where=half > 1e-6)
    length = (np.linalg.norm(p1 - p0, axis=1) * longer)[:, None]
    return Curves(p0, p1, first * length, last * length)


def phong(p0: Rows, p1: Rows, first: Rows, last: Rows) -> Curves:
    """Quadratic curves of Phong tessellation between points with these unit directions (Boubekeur and Alexa 2008).

    Each end projects the chord onto its direction; `BLEND` of that and the rest of the chord itself. The paper's
    examples blend 3/4. Neighbours agree on where a curve ends, but not on its direction there.
    """
    chord = p1 - p0
    lift = BLEND * (dots(chord, first)[:, None] * first - dots(chord, last)[:, None] * last)
    return Curves(p0, p1, chord + lift, chord - lift)


def straight(p0: Rows, p1: Rows) -> Curves:
    """Curves that are their chords."""
    return Curves(p0, p1, p1 - p0, p1 - p0)
