"""Diffuse shading of view samples, row by row: the kernels behind `umbrae.shade`.

A surface of opacity a, of which a share t lets light through in colour c (see `umbrae.transmission`), sheds
a ((1 - t) diffuse + t F sky) and lets (1 - a) + a t (1 - F) c of what lies behind pass: of the share that is glass, F
is mirrored instead of transmitted, so that glass is seen as glass. Layers are put together front to back.

The tone of the picture is fixed by the constants below: a surface that squarely faces a light of intensity 1
receives 1, sky and ground fill every shadow with about a fifth of that, and a shoulder keeps full sun on
white from clipping.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.glass import mirrored
from umbrae.geometry.mipmap import LINEAR_TO_SRGB, SRGB_CODES, fetch_footprint, footprint
from umbrae.geometry.normals import facet_normal, smooth_normal, towards_light
from umbrae.geometry.texture import fetch
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

ALONE, BEFORE, LAST, CHOSEN = range(4)
"""How surfaces are shown: as if solid, with a layer behind them, as the last of several layers, or as the only ones
that their samples see, by chance."""


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
    """`(m, 4)`."""
    blended: NDArray[np.bool_]
    """Per material, whether its opacity counts where it is seen: it has alpha mode BLEND."""
    transmitted: NDArray[np.float64]
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
    partial: NDArray[np.float32]
    """`(p, h, w, s, 3)` the share that arrives, of those lights of which it may be any."""
    slot: NDArray[np.int64]
    """`(n,)` index into `partial`; -1 for a light that arrives or does not."""
    fade: NDArray[np.float32]
    """`(n, v, 2)` of `terminator_fade`; no rows without smooth normals."""


@kernel
def shade_rows(
    first: int,
    last: int,
    surface: Surface,
    view: View,
    lighting: Lighting,
    shown: int,
    through: NDArray[np.float64],
    light: NDArray[np.float64],
) -> None:
    """Add to `light` what a layer's rows `first` to `last - 1` shed towards the eye, and take what stops off `through`.

    Both are `(last - first, w, s, 3)`, linear RGB: what arrives at the eye, and the share of what lies behind all
    layers so far that does. `shown` is `ALONE`, `BEFORE`, `LAST` or `CHOSEN`.
    """
    # Unpacked here, once: every access to a member inside the loop would count references.
    positions, triangles, normals, _first, colors, uv, material_id, base_color, blended, transmitted = surface[:10]
    texels, offset, size, slot, levels = surface[10:]
    triangle, barycentric, side, position, covered, pinhole = view
    light_position, radiance, in_shadow, partial, partial_slot, fade = lighting
    eye, forward, corner = row(pinhole, 0), row(pinhole, 1), row(pinhole, 2)
    right, down, up = row(pinhole, 3), row(pinhole, 4), row(pinhole, 5)
    width, per_pixel = triangle.shape[1], triangle.shape[2]
    spacing = 1.0 / math.sqrt(per_pixel)
    # Block by block: neighbours in the picture are neighbours in textures and meshes, and still in the cache.
    for block in range(-(-width // _BLOCK_PX) * (last - first)):
        column, y = divmod(block, last - first)
        y += first
        for x in range(column * _BLOCK_PX, min((column + 1) * _BLOCK_PX, width)):
            for s in range(per_pixel):
                left = _get(through, y - first, x, s)
                if left[0] == 0.0 and left[1] == 0.0 and left[2] == 0.0:
                    continue
                t = triangle[y, x, s]
                if t < 0 or not covered[y, x, s]:
                    ray = add(corner, add(scale(x + 0.5, right), scale(y + 0.5, down)))
                    _add(light, y - first, x, s, times(left, _background(ray, up)))
                    _put(through, y - first, x, s, (0.0, 0.0, 0.0))
                    continue
                a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
                v, w = np.float64(barycentric[y, x, s, 0]), np.float64(barycentric[y, x, s, 1])
                px, py, pz = position[y, x, s, 0], position[y, x, s, 1], position[y, x, s, 2]
                point = (np.float64(px), np.float64(py), np.float64(pz))
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

                shed = _ambient(normal, to_eye, up)
                for k in range(light_position.shape[0]):
                    if in_shadow[k, y, x, s]:
                        continue
                    share = DIRECT * dot(normal, towards_light(light_position, k, point))
                    if agreement != 0.0:
                        share *= _mean(fade[k, a, back], fade[k, b, back], fade[k, c, back], v, w)
                    arriving = row(radiance, k)
                    if partial_slot[k] >= 0:
                        p = partial_slot[k]
                        red, green, blue = partial[p, y, x, s, 0], partial[p, y, x, s, 1], partial[p, y, x, s, 2]
                        arriving = times(arriving, (np.float64(red), np.float64(green), np.float64(blue)))
                    shed = add(shed, scale(max(0.0, share), arriving))

                m = material_id[t]
                tint = row(base_color, m)
                shed = times(shed, tint)
                if colors.shape[0] > 0:
                    color = interpolate(colors, a, b, c, v, w)
                    shed, tint = times(shed, color), times(tint, color)
                at_u = at_v = 0.0
                if levels[m] > 0:
                    ray = subtract(point, eye)
                    depth = spacing * dot(ray, forward)
                    across, below = footprint(positions, uv, a, b, c, ray, scale(depth, right), scale(depth, down))
                    at_u = _mean(uv[a, 0], uv[b, 0], uv[c, 0], v, w)
                    at_v = _mean(uv[a, 1], uv[b, 1], uv[c, 1], v, w)
                    texel = fetch_footprint(texels, offset, size, slot[m], levels[m], at_u, at_v, across, below)
                    shed, tint = times(shed, texel), times(tint, texel)

                opacity, glass = 1.0, 0.0
                if shown != ALONE and transmitted[m] > 0.0:
                    glass = transmitted[m]
                    mirror = glass * mirrored(normal, to_eye)
                    turned = subtract(scale(2.0 * dot(normal, to_eye), normal), to_eye)
                    shed = add(scale(1.0 - glass, shed), scale(mirror, _background(turned, up)))
                    glass -= mirror
                if blended[m] and shown in (BEFORE, LAST):
                    # Where samples find no hole, the opacity right there: a mean over the footprint would count holes
                    # a second time.
                    opacity = base_color[m, 3]
                    if levels[m] > 0:
                        opacity *= fetch(texels, offset, size, slot[m], at_u, at_v)[3]
                    if colors.shape[0] > 0:
                        opacity *= _mean(colors[a, 3], colors[b, 3], colors[c, 3], v, w)
                _add(light, y - first, x, s, times(left, scale(opacity, shed)))
                clear = 1.0 - opacity
                left = times(left, add((clear, clear, clear), scale(opacity * glass, tint)))
                if shown in (ALONE, CHOSEN):
                    left = (0.0, 0.0, 0.0)
                if shown == LAST and (left[0] > 0.0 or left[1] > 0.0 or left[2] > 0.0):
                    ray = add(corner, add(scale(x + 0.5, right), scale(y + 0.5, down)))
                    _add(light, y - first, x, s, times(left, _background(ray, up)))
                _put(through, y - first, x, s, left)


@kernel
def tone_rows(first: int, last: int, mean_first: bool, light: NDArray[np.float64], pixels: NDArray[np.uint8]) -> None:
    """Write rows `first` to `last - 1` of `pixels (h, w, 3)`, sRGB, from `light (last - first, w, s, 3)`.

    The samples of a pixel are averaged between tone mapping and the sRGB transfer: before it, one bright
    sample would outweigh the others and edges against bright surfaces would stay stairs. `mean_first` averages before
    both, which samples chosen by chance need: it is their mean that is right.
    """
    per_pixel = light.shape[2]
    for y in range(first, last):
        for x in range(light.shape[1]):
            total = (0.0, 0.0, 0.0)
            for s in range(per_pixel):
                value = _get(light, y - first, x, s)
                total = add(total, value if mean_first else _tone(value))
            if mean_first:
                total = scale(per_pixel, _tone(scale(1.0 / per_pixel, total)))
            total = scale(SRGB_CODES / per_pixel, total)
            pixels[y, x, 0] = LINEAR_TO_SRGB[int(total[0] + 0.5)]
            pixels[y, x, 1] = LINEAR_TO_SRGB[int(total[1] + 0.5)]
            pixels[y, x, 2] = LINEAR_TO_SRGB[int(total[2] + 0.5)]


@inline
def _get(array: NDArray[np.float64], y: int, x: int, s: int) -> Vec3:
    return array[y, x, s, 0], array[y, x, s, 1], array[y, x, s, 2]


@inline
def _put(array: NDArray[np.float64], y: int, x: int, s: int, value: Vec3) -> None:
    array[y, x, s, 0], array[y, x, s, 1], array[y, x, s, 2] = value


@inline
def _add(array: NDArray[np.float64], y: int, x: int, s: int, value: Vec3) -> None:
    _put(array, y, x, s, add(_get(array, y, x, s), value))


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
