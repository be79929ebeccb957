"""Diffuse shading of view samples, row by row: the kernel behind `umbrae.shade`.

The tone of the picture is fixed by the constants below: a surface that squarely faces a light of intensity 1
receives 1, sky and ground fill every shadow with about a third of that, and a shoulder keeps full sun on
white from clipping.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.mipmap import LINEAR_TO_SRGB, SRGB_CODES, fetch_footprint
from umbrae.geometry.normals import facet_normal, smooth_normal, towards_light
from umbrae.geometry.vectors import Vec3, add, cross, dot, interpolate, mix, row, scale, subtract, times, unit
from umbrae.parallel import inline, kernel

DIRECT = 0.88
"""What a surface receives that squarely faces a white light of intensity 1."""
SKY_LIGHT = (0.23, 0.27, 0.34)
"""What a surface receives that faces straight up, linear RGB."""
GROUND_LIGHT = (0.20, 0.175, 0.15)
"""What a surface receives that faces straight down: the sun's bounce off the ground."""
FACING_FILL = 0.25
"""Share of the ambient light that depends on how squarely a surface faces the eye: dark walls differ."""
HORIZON = (0.66, 0.76, 0.86)
ZENITH = (0.16, 0.36, 0.68)
GROUND = (0.235, 0.235, 0.24)
"""Background, linear RGB: the sky at the horizon and overhead, and the ground under the eye."""
SHOULDER = 0.65
"""Linear value above which highlights are compressed towards 1."""


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
    width, per_pixel = view.triangle.shape[1], view.triangle.shape[2]
    for y in range(first, last):
        for x in range(width):
            total = (0.0, 0.0, 0.0)
            for s in range(per_pixel):
                if view.covered[y, x, s] and view.triangle[y, x, s] >= 0:
                    light = _surface_light(surface, view, lighting, y, x, s)
                else:
                    light = _background(view, y, x)
                total = add(total, (_tone(light[0]), _tone(light[1]), _tone(light[2])))
            total = scale(SRGB_CODES / per_pixel, total)
            pixels[y, x, 0] = LINEAR_TO_SRGB[int(total[0] + 0.5)]
            pixels[y, x, 1] = LINEAR_TO_SRGB[int(total[1] + 0.5)]
            pixels[y, x, 2] = LINEAR_TO_SRGB[int(total[2] + 0.5)]


@inline
def _tone(value: float) -> float:
    """Light as it is up to the shoulder, then ever slower towards 1, without a kink."""
    if value <= SHOULDER:
        return max(0.0, value)
    excess = (min(value, 1e9) - SHOULDER) / (1.0 - SHOULDER)
    return SHOULDER + (1.0 - SHOULDER) * excess / (1.0 + excess)


@inline
def _background(view: View, y: int, x: int) -> Vec3:
    """Sky above the horizon, calm ground below, by the direction of the pixel's centre."""
    right, down = scale(x + 0.5, row(view.pinhole, 3)), scale(y + 0.5, row(view.pinhole, 4))
    direction = unit(add(row(view.pinhole, 2), add(right, down)))
    height = dot(direction, row(view.pinhole, 5))
    color: Vec3
    if height >= 0.0:
        color = mix(HORIZON, ZENITH, 1.0 - math.exp(-3.0 * height))
    else:
        color = mix(HORIZON, GROUND, 1.0 - math.exp(12.0 * height))
    return color


@inline
def _surface_light(surface: Surface, view: View, lighting: Lighting, y: int, x: int, s: int) -> Vec3:
    """Light that a sample on a surface sends to the eye."""
    t = view.triangle[y, x, s]
    a, b, c = surface.triangles[t, 0], surface.triangles[t, 1], surface.triangles[t, 2]
    v, w = float(view.barycentric[y, x, s, 0]), float(view.barycentric[y, x, s, 1])
    position = (
        float(view.position[y, x, s, 0]),
        float(view.position[y, x, s, 1]),
        float(view.position[y, x, s, 2]),
    )
    to_eye = unit(subtract(row(view.pinhole, 0), position))

    # The facet's normal by its winding, or the smooth one, turned to the side the sample is seen from.
    facet = facet_normal(surface.positions, a, b, c)
    turn = float(view.side[y, x, s])
    if turn == 0.0:
        turn = 1.0 if dot(facet, to_eye) >= 0.0 else -1.0
    normal, agreement = facet, 0.0
    if surface.normals.shape[0] > 0:
        smooth, agreement = smooth_normal(surface.normals, a, b, c, v, w, facet)
        if agreement != 0.0:
            normal = smooth
            turn *= agreement
    normal = scale(turn, normal)
    back = 0 if turn > 0.0 else 1

    facing = 1.0 - FACING_FILL + FACING_FILL * max(0.0, dot(normal, to_eye))
    light: Vec3 = scale(facing, mix(GROUND_LIGHT, SKY_LIGHT, 0.5 + 0.5 * dot(normal, row(view.pinhole, 5))))
    for k in range(lighting.position.shape[0]):
        if lighting.in_shadow[k, y, x, s]:
            continue
        to_light = towards_light(row(lighting.position, k), lighting.position[k, 3], position)
        share = max(0.0, dot(normal, to_light))
        if agreement != 0.0:
            share *= (
                (1.0 - v - w) * lighting.fade[k, a, back]
                + v * lighting.fade[k, b, back]
                + w * lighting.fade[k, c, back]
            )
        light = add(light, scale(DIRECT * share, row(lighting.radiance, k)))

    m = surface.material_id[t]
    light = times(light, row(surface.base_color, m))
    if surface.colors.shape[0] > 0:
        light = times(light, interpolate(surface.colors, a, b, c, v, w))
    if surface.levels[m] > 0:
        light = times(light, _texture(surface, view, m, a, b, c, v, w, position))
    return light


@inline
def _texture(
    surface: Surface, view: View, m: int, a: int, b: int, c: int, v: float, w: float, position: Vec3
) -> Vec3:
    """The texture of material `m`, averaged over the footprint of one sample on triangle `a b c`."""
    start = row(surface.positions, a)
    ab, ac = subtract(row(surface.positions, b), start), subtract(row(surface.positions, c), start)
    normal = cross(ab, ac)
    area = max(dot(normal, normal), 1e-300)
    # Barycentrics are linear in the plane: v = (p - a) . (ac x n) / n.n and w = (p - a) . (n x ab) / n.n.
    gradient_v, gradient_w = scale(1.0 / area, cross(ac, normal)), scale(1.0 / area, cross(normal, ab))
    u_a, v_a = float(surface.uv[a, 0]), float(surface.uv[a, 1])
    ab_u, ab_v = float(surface.uv[b, 0]) - u_a, float(surface.uv[b, 1]) - v_a
    ac_u, ac_v = float(surface.uv[c, 0]) - u_a, float(surface.uv[c, 1]) - v_a

    ray = subtract(position, row(view.pinhole, 0))
    steepness = dot(ray, normal)
    # Samples of one pixel share its area.
    depth = dot(ray, row(view.pinhole, 1)) / math.sqrt(view.triangle.shape[2])
    across = _slide(scale(depth, row(view.pinhole, 3)), ray, normal, steepness)
    down = _slide(scale(depth, row(view.pinhole, 4)), ray, normal, steepness)
    across_v, across_w = dot(across, gradient_v), dot(across, gradient_w)
    down_v, down_w = dot(down, gradient_v), dot(down, gradient_w)
    color: Vec3 = fetch_footprint(
        surface.texels,
        surface.offset,
        surface.size,
        surface.slot[m],
        surface.levels[m],
        u_a + v * ab_u + w * ac_u,
        v_a + v * ab_v + w * ac_v,
        (across_v * ab_u + across_w * ac_u, across_v * ab_v + across_w * ac_v),
        (down_v * ab_u + down_w * ac_u, down_v * ab_v + down_w * ac_v),
    )
    return color


@inline
def _slide(step: Vec3, ray: Vec3, normal: Vec3, steepness: float) -> Vec3:
    """How far the hit point moves in the triangle's plane when the ray's end moves by `step`: first order."""
    if steepness != 0.0:
        step = subtract(step, scale(dot(step, normal) / steepness, ray))
    return step
