"""Where on a light with a size its samples lie: the same places for every method, and for the truth.

A light with a size is sampled as the disc that faces the view sample. For a sphere around l seen from P that is the
disc through l at right angles to l - P, with the sphere's radius: a little narrower than the sphere looks from very
near, and still there for a P inside it (at l itself it faces along z). For a directional light it is the round patch
of sky around its direction, all of which is equally bright.

Light sample i of n lies on the unit disc at

    radius sqrt((i + shift) / n),   angle i * golden angle + turn

(Vogel's spiral: one sample in each of n rings of equal area). `shift`, in (0, 1), and `turn`, one of `TURNS` angles,
differ from view sample to view sample by low-discrepancy sequences over the grid of pixels, so that neighbours see
the light in different places and what is left of the error is fine grain without bands. In a list, the index takes
the place of row and column.

Each pair of view sample and light sample is thus one light position of float32 numbers, and a mask is exact when it
holds the answer of the exact predicate for each of them. `light_samples` gives these positions to anybody,
`fill_lights` the same to the last bit inside kernels: only operations that IEEE 754 rounds correctly, in one order.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import whole
from umbrae.errors import OptionError
from umbrae.light import Light
from umbrae.methods.method import LIGHT_SAMPLES
from umbrae.parallel import inline
from umbrae.samples import ViewSamples

TURNS = 256

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))

_ONE = 1 << 24
_TURN_STEPS = tuple(round(step * _ONE) for step in (0.7548776662466927, 0.5698402909980532, 0.6180339887498949))
_SHIFT_STEPS = tuple(round(step * _ONE) for step in (math.sqrt(2) - 1, math.sqrt(3) - 1, math.sqrt(5) - 2))
"""Steps from row to row, from column to column and within a pixel, in units of 2**-24.

The first two are the plane's analogue of the golden ratio (the powers of the inverse plastic number, "R2").
"""
_TURN_ROW, _TURN_COLUMN, _TURN_INNER = _TURN_STEPS
_SHIFT_ROW, _SHIFT_COLUMN, _SHIFT_INNER = _SHIFT_STEPS


class LightDisc(NamedTuple):
    """A light with a size, as kernels take it.

    Attributes
    ----------
    source
        `(4,) float64` the middle: the light's position, or a direction whose largest component lies in [1, 2).
    extent
        Radius of the sphere; or height of the cap of directions, 1 - cos(half the angular diameter).
    reach
        No light sample is farther than this from `source`, with all roundings.
    pattern
        `(n, 2) float64` cosine and sine of i golden angles.
    turns
        `(TURNS, 2) float64` cosine and sine.
    columns, inner
        Shape of the view samples: how many columns there are to a row, and how many samples to a column.
    """

    source: NDArray[np.float64]
    extent: float
    reach: float
    pattern: NDArray[np.float64]
    turns: NDArray[np.float64]
    columns: int
    inner: int


def light_disc(light: Light, count: int, shape: tuple[int, ...]) -> LightDisc:
    """The disc of a light with `count` samples, for view samples of a shape.

    The reach adds to the radius (or the chord of the cap) what rounding to float32 moves a light sample by: each
    component by 2**-24 of itself, and 2**-150 below 2**-126. The factor covers the float64 arithmetic.
    """
    if whole(count, "light_samples") < 1:
        raise OptionError(f"light_samples: wanted at least 1, got {count}")
    source = light.position.astype(np.float64)
    largest = float(np.abs(source[:3]).max())
    if light.is_directional:
        scale = 1 - math.frexp(largest)[1]  # a power of two: the direction stays the same to the last bit
        source = np.ldexp(source, scale)
        extent = 2.0 * math.sin(math.radians(light.angular_diameter) / 4.0) ** 2
        length = float(np.linalg.norm(source))
        reach = math.sqrt(2.0 * extent) * length * (1.0 + 2.0**-20) + 2.0**-22 * length
    else:
        extent = float(light.radius)
        reach = extent * (1.0 + 2.0**-20) + 2.0**-22 * (largest + extent) + 2.0**-149
    return LightDisc(
        source,
        extent,
        reach,
        _circle(_GOLDEN_ANGLE * np.arange(count)),
        _circle(2.0 * math.pi / TURNS * np.arange(TURNS)),
        shape[1] if len(shape) > 1 else 1,
        math.prod(shape[2:]),
    )


def _circle(angle: NDArray[Any]) -> NDArray[np.float64]:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def light_samples(
    light: Light, samples: ViewSamples, count: int = LIGHT_SAMPLES, index: NDArray[np.intp] | None = None
) -> NDArray[np.float32]:
    """The light samples of view samples as homogeneous lights.

    Parameters
    ----------
    samples
        All view samples: where the light samples lie depends on the place among them.
    count
        Light samples for each.
    index
        `(k,)` flat indices of the view samples that are wanted; all by default.

    Returns
    -------
    NDArray
        `(k, count, 4) float32`; w as the light's.
    """
    disc = light_disc(light, count, samples.shape)
    flat = np.arange(samples.size) if index is None else np.asarray(index)
    row, column = flat // (disc.columns * disc.inner), flat // disc.inner % disc.columns
    within = flat % disc.inner
    turn = (row * _TURN_ROW + column * _TURN_COLUMN + within * _TURN_INNER) % _ONE // (_ONE // TURNS)
    shift = (row * _SHIFT_ROW + column * _SHIFT_COLUMN + within * _SHIFT_INNER) % _ONE
    return _placed(disc, samples.position.reshape(-1, 3)[flat], disc.turns[turn], (shift + 0.5) / _ONE)


def fixed_samples(light: Light, seen_from: NDArray[np.floating], count: int) -> NDArray[np.float32]:
    """`(count, 4) float32`: light samples on the disc that faces one point `(3,)`; a single one is its middle."""
    disc = light_disc(light, count, (1,))
    if count == 1:
        return disc.source.astype(np.float32)[None]
    placed = _placed(disc, seen_from.astype(np.float32)[None], np.array([[1.0, 0.0]]), np.array([0.5]))
    return np.asarray(placed[0])


def _placed(
    disc: LightDisc, position: NDArray[np.float32], turn: NDArray[np.float64], shift: NDArray[np.float64]
) -> NDArray[np.float32]:
    """`fill_lights` for positions `(k, 3)`, turns `(k, 2)` and shifts `(k,)`."""
    x, y, z, w = disc.source
    dx, dy, dz = ([x, y, z] - w * position.astype(np.float64)).T
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    nowhere = length == 0.0
    safe = np.where(nowhere, 1.0, length)
    nx, ny, nz = dx / safe, dy / safe, np.where(nowhere, 1.0, dz / safe)
    sign = np.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    first = np.stack([1.0 + sign * nx * nx * a, sign * b, -sign * nx], axis=1)
    second = np.stack([b, sign + ny * ny * a, -ny], axis=1)

    share = (np.arange(len(disc.pattern)) + shift[:, None]) / len(disc.pattern)
    if w == 0.0:
        drop = share * disc.extent
        along = 1.0 - drop
        scale = length[:, None] * np.sqrt(drop * (1.0 + along))
    else:
        along = np.ones_like(share)
        scale = disc.extent * np.sqrt(share)
    cos, sin = disc.pattern.T
    east = scale * (cos * turn[:, :1] - sin * turn[:, 1:])
    north = scale * (sin * turn[:, :1] + cos * turn[:, 1:])
    lights = np.empty((*share.shape, 4), np.float32)
    for axis in range(3):
        lights[..., axis] = disc.source[axis] * along + (east * first[:, axis, None] + north * second[:, axis, None])
    lights[..., 3] = w
    return lights


@inline
def fill_lights(disc, index, x, y, z, lights, start):
    """Write the light samples of the view sample with a flat index, at x, y, z, into three rows of float32 numbers.

    The frame around the axis is that of Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    """
    row, rest = index // (disc.columns * disc.inner), index % (disc.columns * disc.inner)
    column, within = rest // disc.inner, rest % disc.inner
    turn = (row * _TURN_ROW + column * _TURN_COLUMN + within * _TURN_INNER) % _ONE // (_ONE // TURNS)
    shift = ((row * _SHIFT_ROW + column * _SHIFT_COLUMN + within * _SHIFT_INNER) % _ONE + 0.5) / _ONE
    turn_cos, turn_sin = disc.turns[turn, 0], disc.turns[turn, 1]

    lx, ly, lz, w = disc.source[0], disc.source[1], disc.source[2], disc.source[3]
    nx, ny, nz = lx - w * np.float64(x), ly - w * np.float64(y), lz - w * np.float64(z)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        nz = 1.0
    else:
        nx, ny, nz = nx / length, ny / length, nz / length
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    ux, uy, uz = 1.0 + sign * nx * nx * a, sign * b, -sign * nx
    vx, vy, vz = b, sign + ny * ny * a, -ny

    count = len(disc.pattern)
    for i in range(count):
        share = (i + shift) / count
        if w == 0.0:
            drop = share * disc.extent
            along = 1.0 - drop
            scale = length * math.sqrt(drop * (1.0 + along))
        else:
            along = 1.0
            scale = disc.extent * math.sqrt(share)
        east = scale * (disc.pattern[i, 0] * turn_cos - disc.pattern[i, 1] * turn_sin)
        north = scale * (disc.pattern[i, 1] * turn_cos + disc.pattern[i, 0] * turn_sin)
        lights[start + 0, i] = lx * along + (east * ux + north * vx)
        lights[start + 1, i] = ly * along + (east * uy + north * vy)
        lights[start + 2, i] = lz * along + (east * uz + north * vz)
