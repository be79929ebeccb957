"""Diffuse shading of view samples, row by row: the kernel behind `umbrae.shade`.

The tone of the picture is fixed by the constants below: a surface that squarely faces a light of intensity 1
receives 1, sky and ground fill every shadow with about a fifth of that, and a shoulder keeps full sun on
white from clipping.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.mipmap import LINEAR_TO_SRGB, SRGB_CODES, fetch_footprint, footprint
from umbrae.geometry.normals import facet_normal, smooth_normal, towards_light
from umbrae.geometry.vectors import Vec3, add, dot, interpolate, mix, row, scale, subtract, times, unit
from umbrae.parallel import inline, kernel

DIRECT = 1.25
"""What a surface receives that squarely faces a white light of intensity 1."""
SKY_LIGHT = (0.155, 0.195, 0.265)
"""What a surface receives that faces straight up, linear RGB."""
GROUND_LIGHT = (0.15, 0.13, 0.11)
"""What a surface receives that faces straight down: the sun's bounce off the ground."""
FACING_FILL = 0.25
"""Share of the ambient light that depends on how squarely a surface faces the eye: dark walls differ."""
HORIZON = (0.74, 0.80, 0.86)
ZENITH = (0.16, 0.36, 0.68)
GROUND = (0.52, 0.52, 0.51)
"""Background, linear RGB: the sky at the horizon and overhead, and the ground under the eye."""
SHOULDER = 0.65
"""Linear value above which highlights are compressed towards 1."""
_BLOCK_PX = 32


class Surface(NamedTuple):
    """What is looked up at a sample; an absent array has no rows."""

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    normals: NDArray[np.float32]
    first: NDArray[np.int32]
    """`first_alike` of the vertices."""
    colors: NDArray[np.float32]
    uv: NDArray[np.float32]
    material_id: NDArray[np.int32]
    base_color: NDArray[np.float64]
    texels: NDArray[np.uint8]
    offset: NDArray[np.int64]
    size: NDArray[np.int64]
    slot: NDArray[np.int64]
    """Per material, the first of its texture's levels among `offset` and `size`."""
    levels: NDArray[np.int64]
    """Per material, how many levels its texture has; 0 without one."""


class View(NamedTuple):
    """The view samples `(h, w, s)` and the pinhole they are seen through."""

    triangle: NDArray[np.int32]
    barycentric: NDArray[np.float32]
    side: NDArray[np.int8]
    position: NDArray[np.float32]
    covered: NDArray[np.bool_]
    pinhole: NDArray[np.float64]
    """`(6, 3)`: the eye; the view direction; the direction through the picture's top left corner, one unit
    deep; its step to the next pixel and to the next row; world up."""


class Lighting(NamedTuple):
    """All lights of a picture."""

    position: NDArray[np.float64]
    """`(n, 4)` homogeneous."""
    radiance: NDArray[np.float64]
    """`(n, 3)` on a surface that squarely faces the light."""
    in_shadow: NDArray[np.bool_]
    """`(n, h, w, s)`."""
    fade: NDArray[np.float32]
    """`(n, v, 2)` of `terminator_fade`; no rows without smooth normals."""


@kernel
def shade_rows(
    first: int, last: int, surface: Surface, view: View, lighting: Lighting, pixels: NDArray[np.uint8]
) -> None:
    """Write rows `first` to `last - 1` of `pixels (h, w, 3)`, sRGB.

    The samples of a pixel are averaged between tone mapping and the sRGB transfer: before it, one bright
    sample would outweigh the others and edges against bright surfaces would stay stairs.
    """
    # Unpacked here, once: every access to a member inside the loop would count references.
    positions, triangles, normals, _first, colors, uv, material_id, base_color = surface[:8]
    texels, offset, size, slot, levels = surface[8:]
    triangle, barycentric, side, position, covered, pinhole = view
    light_position, radiance, in_shadow, fade = lighting
    eye, forward, corner = row(pinhole, 0), row(pinhole, 1), row(pinhole, 2)
    right, down, up = row(pinhole, 3), row(pinhole, 4), row(pinhole, 5)
    width, per_pixel = triangle.shape[1], triangle.shape[2]
    spacing = 1.0 / math.sqrt(per_pixel)
    # Block by block: neighbours in the picture are neighbours in textures and meshes, and still in the cache.
    for block in range(-(-width // _BLOCK_PX) * (last - first)):
        column, y = divmod(block, last - first)
        y += first
        for x in range(column * _BLOCK_PX, min((column + 1) * _BLOCK_PX, width)):
            total = (0.0, 0.0, 0.0)
            for s in range(per_pixel):
                t = triangle[y, x, s]
                if t < 0 or not covered[y, x, s]:
                    ray = add(corner, add(scale(x + 0.5, right), scale(y + 0.5, down)))
                    total = add(total, _tone(_background(ray, up)))
                    continue
                a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
                v, w = float(barycentric[y, x, s, 0]), float(barycentric[y, x, s, 1])
                px, py, pz = position[y, x, s, 0], position[y, x, s, 1], position[y, x, s, 2]
                point = (float(px), float(py), float(pz))
                to_eye = unit(subtract(eye, point))

                # The facet's normal by its winding, or the smooth one, turned to the side it is seen from.
                normal, agreement = facet_normal(positions, a, b, c), 0.0
                turn = float(side[y, x, s])
                if turn == 0.0:
                    turn = 1.0 if dot(normal, to_eye) >= 0.0 else -1.0
                if normals.shape[0] > 0:
                    smooth, agreement = smooth_normal(normals, a, b, c, v, w, normal)
                    if agreement != 0.0:
                        normal = smooth
                        turn *= agreement
                normal = scale(turn, normal)
                back = 0 if turn > 0.0 else 1

                light = _ambient(normal, to_eye, up)
                for k in range(light_position.shape[0]):
                    if in_shadow[k, y, x, s]:
                        continue
                    share = DIRECT * dot(normal, towards_light(light_position, k, point))
                    if agreement != 0.0:
                        share *= _mean(fade[k, a, back], fade[k, b, back], fade[k, c, back], v, w)
                    light = add(light, scale(max(0.0, share), row(radiance, k)))

                m = material_id[t]
                light = times(light, row(base_color, m))
                if colors.shape[0] > 0:
                    light = times(light, interpolate(colors, a, b, c, v, w))
                if levels[m] > 0:
                    ray = subtract(point, eye)
                    depth = spacing * dot(ray, forward)
                    across, below = footprint(positions, uv, a, b, c, ray, scale(depth, right), scale(depth, down))
                    at_u = _mean(uv[a, 0], uv[b, 0], uv[c, 0], v, w)
                    at_v = _mean(uv[a, 1], uv[b, 1], uv[c, 1], v, w)
                    texel = fetch_footprint(texels, offset, size, slot[m], levels[m], at_u, at_v, across, below)
                    light = times(light, texel)
                total = add(total, _tone(light))
            total = scale(SRGB_CODES / per_pixel, total)
            pixels[y, x, 0] = LINEAR_TO_SRGB[int(total[0] + 0.5)]
            pixels[y, x, 1] = LINEAR_TO_SRGB[int(total[1] + 0.5)]
            pixels[y, x, 2] = LINEAR_TO_SRGB[int(total[2] + 0.5)]


@inline
def _mean(at_a: float, at_b: float, at_c: float, v: float, w: float) -> float:
    """Three vertices' values at barycentrics `(1 - v - w, v, w)`."""
    return (1.0 - v - w) * at_a + v * at_b + w * at_c


@inline
def _tone(light: Vec3) -> Vec3:
    return _shoulder(light[0]), _shoulder(light[1]), _shoulder(light[2])


@inline
def _shoulder(value: float) -> float:
    """Light as it is up to the shoulder, then ever slower towards 1, without a kink."""
    if value <= SHOULDER:
        return max(0.0, value)
    excess = (min(value, 1e9) - SHOULDER) / (1.0 - SHOULDER)
    return SHOULDER + (1.0 - SHOULDER) * excess / (1.0 + excess)


@inline
def _background(ray: Vec3, up: Vec3) -> Vec3:
    """Sky above the horizon, calm ground below."""
    height = dot(unit(ray), up)
    color: Vec3
    if height >= 0.0:
        color = mix(HORIZON, ZENITH, 1.0 - math.exp(-3.0 * height))
    else:
        color = mix(HORIZON, GROUND, 1.0 - math.exp(12.0 * height))
    return color


@inline
def _ambient(normal: Vec3, to_eye: Vec3, up: Vec3) -> Vec3:
    """Light from the sky above and from the ground below."""
    facing = 1.0 - FACING_FILL + FACING_FILL * max(0.0, dot(normal, to_eye))
    light: Vec3 = scale(facing, mix(GROUND_LIGHT, SKY_LIGHT, 0.5 + 0.5 * dot(normal, up)))
    return light
