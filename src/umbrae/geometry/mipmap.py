"""Smaller and smaller copies of a texture, and the look-up that averages over a pixel's footprint."""

import math

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.texture import SRGB_TO_LINEAR, fetch
from umbrae.geometry.vectors import Vec3, cross, dot, row, scale, subtract
from umbrae.parallel import inline, kernel

MAX_TAPS = 4
"""Look-ups along the longer axis of a footprint: floors at more grazing angles than that blur."""

SRGB_CODES = 65535


def _linear_to_srgb() -> NDArray[np.uint8]:
    linear = np.linspace(0, 1, SRGB_CODES + 1)
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)
    return np.round(255 * coded).astype(np.uint8)


LINEAR_TO_SRGB = _linear_to_srgb()
"""`(65536,)` uint8: sRGB code of linear light in steps of 1/65535, a twentieth of a code or less each."""


def mip_levels(texture: NDArray[np.uint8], opaque: bool) -> list[NDArray[np.uint8]]:
    """The texture, then halves of it down to a single texel.

    Parameters
    ----------
    texture
        `(h, w, 4) uint8`, sRGB colour with linear alpha.
    opaque
        Whether alpha means nothing. If it does mean something, texels count by their alpha, and those that
        are fully transparent take the colour of their surroundings: nothing of what the eye cannot see bleeds
        into the edges.
    """
    levels = [texture.copy()]
    while max(levels[-1].shape[:2]) > 1:
        fine = levels[-1]
        coarse = np.empty((max(1, fine.shape[0] // 2), max(1, fine.shape[1] // 2), 4), np.uint8)
        _shrink(fine, opaque, coarse)
        levels.append(coarse)
    if not opaque:
        for coarse, fine in zip(levels[:0:-1], levels[-2::-1], strict=True):
            _fill_transparent(coarse, fine)
    return levels


@kernel
def _shrink(fine: NDArray[np.uint8], opaque: bool, coarse: NDArray[np.uint8]) -> None:
    """Box filter in linear light; in odd sizes a texel on the border of two boxes counts for both in part."""
    height, width = coarse.shape[0], coarse.shape[1]
    step_y, step_x = fine.shape[0] / height, fine.shape[1] / width
    for y in range(height):
        for x in range(width):
            red = green = blue = alpha = area = weight = 0.0
            for j in range(int(y * step_y), min(fine.shape[0], math.ceil((y + 1) * step_y))):
                share_y = min(j + 1.0, (y + 1) * step_y) - max(float(j), y * step_y)
                for i in range(int(x * step_x), min(fine.shape[1], math.ceil((x + 1) * step_x))):
                    share = share_y * (min(i + 1.0, (x + 1) * step_x) - max(float(i), x * step_x))
                    part = share if opaque else share * fine[j, i, 3]
                    area += share
                    weight += part
                    alpha += share * fine[j, i, 3]
                    red += part * SRGB_TO_LINEAR[fine[j, i, 0]]
                    green += part * SRGB_TO_LINEAR[fine[j, i, 1]]
                    blue += part * SRGB_TO_LINEAR[fine[j, i, 2]]
            scale = SRGB_CODES / weight if weight > 0.0 else 0.0
            coarse[y, x, 0] = LINEAR_TO_SRGB[int(red * scale + 0.5)]
            coarse[y, x, 1] = LINEAR_TO_SRGB[int(green * scale + 0.5)]
            coarse[y, x, 2] = LINEAR_TO_SRGB[int(blue * scale + 0.5)]
            coarse[y, x, 3] = int(alpha / area + 0.5)


@kernel
def _fill_transparent(coarse: NDArray[np.uint8], fine: NDArray[np.uint8]) -> None:
    for y in range(fine.shape[0]):
        for x in range(fine.shape[1]):
            if fine[y, x, 3] == 0:
                above = coarse[min(y // 2, coarse.shape[0] - 1), min(x // 2, coarse.shape[1] - 1)]
                fine[y, x, 0], fine[y, x, 1], fine[y, x, 2] = above[0], above[1], above[2]


@inline
def footprint(
    positions: NDArray[np.float32],
    uv: NDArray[np.float32],
    a: int,
    b: int,
    c: int,
    ray: Vec3,
    right: Vec3,
    down: Vec3,
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Steps (du, dv) on triangle `a b c` when the end of the ray from the eye moves by `right` and `down`.

    To first order: the end slides along the triangle's plane.
    """
    start = row(positions, a)
    ab, ac = subtract(row(positions, b), start), subtract(row(positions, c), start)
    normal = cross(ab, ac)
    steepness = dot(ray, normal)
    if steepness != 0.0:
        right = subtract(right, scale(dot(right, normal) / steepness, ray))
        down = subtract(down, scale(dot(down, normal) / steepness, ray))
    # Barycentrics are linear in the plane: v = (p - a) . (ac x n) / n.n and w = (p - a) . (n x ab) / n.n.
    area = max(dot(normal, normal), 1e-300)
    along_v, along_w = scale(1.0 / area, cross(ac, normal)), scale(1.0 / area, cross(normal, ab))
    ab_u, ab_v = np.float64(uv[b, 0]) - uv[a, 0], np.float64(uv[b, 1]) - uv[a, 1]
    ac_u, ac_v = np.float64(uv[c, 0]) - uv[a, 0], np.float64(uv[c, 1]) - uv[a, 1]
    right_v, right_w = dot(right, along_v), dot(right, along_w)
    down_v, down_w = dot(down, along_v), dot(down, along_w)
    return (
        (right_v * ab_u + right_w * ac_u, right_v * ab_v + right_w * ac_v),
        (down_v * ab_u + down_w * ac_u, down_v * ab_v + down_w * ac_v),
    )


@inline
def fetch_footprint(texels, offset, size, slot, levels, u, v, across, down):  # type: ignore[no-untyped-def]
    """Linear red, green and blue of a texture averaged over the parallelogram `across` x `down` at (u, v).

    Levels lie behind one another from `slot` on, as separate textures. Trilinear along the shorter axis;
    several taps along the longer one, so that a floor seen at a grazing angle stays sharp.

    Parameters
    ----------
    across, down
        Steps (du, dv) to the next pixel and the next row.
    """
    height, width = size[slot, 0], size[slot, 1]
    length_a = math.sqrt((across[0] * width) ** 2 + (across[1] * height) ** 2)
    length_b = math.sqrt((down[0] * width) ** 2 + (down[1] * height) ** 2)
    if length_a >= length_b:
        axis, longer, shorter = across, length_a, length_b
    else:
        axis, longer, shorter = down, length_b, length_a
    taps = 1
    level = 0.0
    if not longer < 1e9:  # a sliver seen edge-on: anything up to infinity, or not a number
        level = levels - 1.0
        axis = (0.0, 0.0)
    elif longer > 1.0:
        taps = int(min(float(MAX_TAPS), longer / max(shorter, 1.0)) + 0.5)
        level = min(levels - 1.0, max(0.0, math.log2(longer / taps)))
    # One level is enough near a whole one; two are blended in between, so that no seam shows.
    near = int(level)
    blend = 2.0 * (level - near) - 0.5
    if blend >= 1.0:
        near += 1
        blend = 0.0
    red = green = blue = 0.0
    for k in range(taps):
        along = (k + 0.5) / taps - 0.5
        tap_u, tap_v = u + along * axis[0], v + along * axis[1]
        r, g, b, _ = fetch(texels, offset, size, slot + near, tap_u, tap_v)
        if blend > 0.0:
            r2, g2, b2, _ = fetch(texels, offset, size, slot + near + 1, tap_u, tap_v)
            r += blend * (r2 - r)
            g += blend * (g2 - g)
            b += blend * (b2 - b)
        red += r
        green += g
        blue += b
    return red / taps, green / taps, blue / taps
