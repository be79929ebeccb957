"""The oracle's factors: what a triangle lets through at the place where the light crosses it, and how sure that is.

`transmission` says what passes; here it is written a second time, in numpy and without a look at the first, from the
scene's materials alone. All vectors start at the sample P: a = A - P, b = B - P, c = C - P and l' = l - w P. With

    t_ab = l' . (a x (B - A)),  t_bc = l' . (b x (C - B)),  t_ca = l' . (c x (A - C))

the place has the barycentrics t_bc, t_ca, t_ab over their sum T: opposite each corner, the volume that light, sample
and edge span.

How sure it is. With u = 2**-53, each t takes 8 roundings, and P is off by 12 u M per component (M the largest
coordinate of the own triangle, 0 for a free point), which l' and a inherit: at most 33 u times the six products, each
no larger than (|l'| + w M)(|a| + M)|B - A| in largest components. We take

    E = 6 * 2**-47 (|l'| + w M)(|a| + M)|B - A|.

The three barycentrics together are then off by at most D = 2 (E_ab + E_bc + E_ca) / T + 2**-50. A value interpolated
between corners is off by D times the spread of the corners' values, texture coordinates also by their rounding, 2**-49
(1 + the largest of them). Between two texels red, green, blue and alpha change by 1 at most, so that a texture is off
by at most the errors of the two coordinates in texels. Four more roundings follow, covered by 2**-49. Twice the sum is
what two programs may differ by, and within that the share of light is known: as 1 - alpha (1 - t c) falls with alpha
and grows with c, its ends are found at the ends of alpha and c. That holds for MASK as well: where alpha is that near
to its cut-off, one end is "there" and the other "not there".
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.material import Material
from umbrae.samples import ViewSamples, surface_points
from umbrae.scene import Scene
from umbrae.transmission import EVEN

_BLOCK = 1 << 14
"""Pairs that are worked on at a time: some hundred bytes each."""

_FILTER = 6.0 * 2.0**-47
_ROUNDING = 2.0**-49

_Floats = NDArray[np.float64]


class Share(NamedTuple):
    """The share of light that passes, `(n, 3) float64`, and between what it may lie when not all is known exactly."""

    value: _Floats
    lowest: _Floats
    highest: _Floats


class Product:
    """What is left of the light at each sample of a list, as casters are found one after the other.

    `lights (n, 4)` has one for each sample. Threads may call `multiply` at the same time for different samples.
    """

    def __init__(
        self, scene: Scene, kind: NDArray[np.uint8], lights: NDArray[np.float32], samples: ViewSamples
    ) -> None:
        self.scene, self.kind, self.lights, self.samples = scene, kind, lights, samples
        ones = np.ones((samples.size, 3))
        self.left = Share(ones, ones.copy(), ones.copy())

    def multiply(self, pairs: NDArray[np.int64]) -> None:
        """Let each triangle of `pairs (n, 2)`, sample and triangle, take its part; none of them is solid or clear."""
        for start in range(0, len(pairs), _BLOCK):
            sample, triangle = pairs[start : start + _BLOCK].T
            weights, doubt = _place(self.scene, self.lights[sample], self.samples.take(sample), triangle)
            share = passing(self.scene, self.kind[triangle] == EVEN, triangle, weights, doubt)
            for left, factor in zip(self.left, share, strict=True):
                np.multiply.at(left, sample, factor)


def _place(
    scene: Scene, lights: NDArray[np.float32], samples: ViewSamples, triangle: NDArray[np.int64]
) -> tuple[_Floats, _Floats]:
    """Barycentrics `(n, 3)` of where the light of each sample crosses a triangle, and by how much they may be off.

    On the own triangle that is where the sample lies.
    """
    own = samples.triangle
    surface = own >= 0
    point, magnitude = samples.position.astype(np.float64), np.zeros(samples.size)
    point[surface] = surface_points(scene, own[surface], samples.barycentric[surface])
    magnitude[surface] = np.abs(scene.positions[scene.triangles[own[surface]]]).max(axis=(1, 2), initial=0)
    source, w = lights[:, :3].astype(np.float64), lights[:, 3].astype(np.float64)
    toward = source - w[:, None] * point
    corners = scene.positions[scene.triangles[triangle]].astype(np.float64)
    opposite, error = np.empty((samples.size, 3)), np.zeros(samples.size)
    for corner in range(3):
        first, second = corners[:, (corner + 1) % 3], corners[:, (corner + 2) % 3]
        arm, edge = first - point, second - first
        opposite[:, corner] = (toward * np.cross(arm, edge)).sum(axis=1)
        error += _FILTER * (_size(toward) + w * magnitude) * (_size(arm) + magnitude) * _size(edge)
    opposite = np.maximum(opposite * np.sign(opposite.sum(axis=1, keepdims=True)), 0.0)
    total = opposite.sum(axis=1)
    nowhere = total <= 0.0
    opposite[nowhere], total[nowhere], error[nowhere] = 1.0, 3.0, np.inf
    weights = opposite / total[:, None]
    # No two sets of barycentrics differ by more than 2.
    doubt = np.minimum(2.0 * error / total + 2.0**-50, 2.0)
    same = np.flatnonzero(own == triangle)
    weights[same, 1:] = samples.barycentric[same]
    weights[same, 0] = 1.0 - weights[same, 1] - weights[same, 2]
    doubt[same] = 2.0**-50
    return weights, doubt


def _size(vectors: _Floats) -> _Floats:
    largest: _Floats = np.abs(vectors).max(axis=1)
    return largest


def passing(
    scene: Scene, even: NDArray[np.bool_], triangle: NDArray[np.int64], weights: _Floats, doubt: _Floats
) -> Share:
    """What triangles `(n,)` let through at barycentrics `(n, 3)` that are off by at most `doubt (n,)` in sum.

    `even (n,)` are those where the place does not matter: nothing of them is in doubt.
    """
    result = Share(*(np.empty((len(triangle), 3)) for _ in range(3)))
    material_id = scene.material_id[triangle]
    for index in np.unique(material_id):
        some = np.flatnonzero(material_id == index)
        color, off = _color(scene, scene.materials[index], triangle[some], weights[some], doubt[some])
        off[even[some]] = 0.0
        for all_of, part in zip(result, _shares(scene.materials[index], color, off), strict=True):
            all_of[some] = part
    return result


def _shares(material: Material, color: _Floats, off: _Floats) -> Share:
    """(1 - a) + a t c for linear colour and alpha `(n, 4)` that are off by at most `off (n, 4)`."""

    def share(c: _Floats, alpha: _Floats) -> _Floats:
        if material.alpha_mode == "OPAQUE":
            alpha = np.ones_like(alpha)
        elif material.alpha_mode == "MASK":
            alpha = (alpha >= material.alpha_cutoff).astype(np.float64)
        return (1.0 - alpha)[:, None] + (alpha * material.transmission)[:, None] * c

    less, more = np.clip(color - off, 0.0, 1.0), np.clip(color + off, 0.0, 1.0)
    return Share(
        share(color[:, :3], color[:, 3]), share(less[:, :3], more[:, 3]), share(more[:, :3], less[:, 3])
    )  # fmt: skip


def _color(
    scene: Scene, material: Material, triangle: NDArray[np.int64], weights: _Floats, doubt: _Floats
) -> tuple[_Floats, _Floats]:
    """Linear colour and alpha `(n, 4)` of base colour, texture and vertex colours, and by how much they may be off."""
    vertices = scene.triangles[triangle]
    base = np.array(material.base_color, np.float64)
    color, off = np.tile(base, (len(triangle), 1)), np.zeros((len(triangle), 4))
    if material.texture is not None:
        uv, slack = np.zeros((len(triangle), 2)), np.zeros((len(triangle), 2))
        if scene.uv is not None:  # without, the texture is the same everywhere (see `transmission_of`)
            corners = scene.uv[vertices].astype(np.float64)
            uv, slack = _between(corners, weights), doubt[:, None] * np.ptp(corners, axis=1)
            slack += _ROUNDING * (1.0 + np.abs(corners).max(axis=1))
        height, width = material.texture.shape[:2]
        color *= _texel(material.texture, uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5)
        off += np.minimum(slack @ np.array([width, height], np.float64), 1.0)[:, None]
    if scene.colors is not None:
        tints = scene.colors[vertices].astype(np.float64)
        color *= _between(tints, weights)
        off += doubt[:, None] * np.ptp(tints, axis=1)
    # No other factor is above 1, so that what each is off by counts at most in full; where the base is 0 nothing does.
    return color, 2.0 * (base * off + _ROUNDING * np.sign(base))


def _between(corners: _Floats, weights: _Floats) -> _Floats:
    """Values `(n, 3, k)` of corners interpolated; exactly their value where they are all the same."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    found: _Floats = a + weights[:, 1:2] * (b - a) + weights[:, 2:3] * (c - a)
    return found


def _texel(texture: NDArray[np.uint8], x: _Floats, y: _Floats) -> _Floats:
    """`(n, 4)` linear colour and alpha, bilinear between texels whose centres lie at whole x and y; repeated."""
    height, width = texture.shape[:2]
    left, top = np.floor(x), np.floor(y)
    # Wrapped as floats: texture coordinates may be larger than any integer type.
    columns = [np.mod(left + step, width).astype(np.intp) for step in (0, 1)]
    rows = [np.mod(top + step, height).astype(np.intp) for step in (0, 1)]
    across, down = (x - left)[:, None], (y - top)[:, None]
    upper, lower = (_mix(_linear(texture[row, columns[0]]), _linear(texture[row, columns[1]]), across) for row in rows)
    return _mix(upper, lower, down)


def _mix(first: _Floats, second: _Floats, share: _Floats) -> _Floats:
    return first + share * (second - first)


def _linear(texels: NDArray[np.uint8]) -> _Floats:
    """8-bit sRGB colour and linear alpha `(n, 4)` as linear light (IEC 61966-2-1)."""
    values = texels / 255.0
    color = values[:, :3]
    values[:, :3] = np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
    return values
