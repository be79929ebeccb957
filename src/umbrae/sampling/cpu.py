"""Primary visibility on all cores: what does the camera see at each sample?

The picture is cut into bands of rows, triangles are listed by the bands they touch, and each band is one
task: it draws its triangles into a depth buffer of its own, then turns what won into view samples. No two
tasks write to the same place and every list is in order of the index, so the result does not depend on the
number of threads.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera, pixel_offsets
from umbrae.checks import instance
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry.texture import Textures, fetch, pack
from umbrae.material import Material
from umbrae.memory import require
from umbrae.parallel import inline, kernel, run
from umbrae.samples import ViewSamples
from umbrae.sampling.bands import Geometry, Picture, corners, list_by_band, project
from umbrae.sampling.coverage import FILTER, covers, orientation, weights
from umbrae.scene import Scene

_BAND_ROWS = 16
_BAND_SAMPLES = 1 << 18
"""A band's depth buffer has at most about this many samples (2 MiB)."""
_WIDE = 8
"""A row's span is narrowed before its pixels are tested when the triangle's box is wider than this."""
_QUANTA = float(1 << 24)
"""Barycentrics are multiples of 2**-24: float32 holds them, their sum and their complement exactly."""
_BYTES_PER_SAMPLE = 4 + 2 * 4 + 1 + 3 * 4 + 1 + 4


class _Surface(NamedTuple):
    """What decides whether an alpha-masked surface is seen through."""

    material_id: NDArray[np.int32]
    cutoff: NDArray[np.float64]  # per material, -1 if opaque
    alpha: NDArray[np.float64]  # per material, of the base colour
    uv: NDArray[np.float32]  # (0, 2) if the scene has none
    colors: NDArray[np.float32]  # (0, 4) if the scene has none
    textures: Textures


def sample(scene: Scene, camera: Camera, samples_per_pixel: int = 1, clock: Clock | None = None) -> ViewSamples:
    """Find the point of the scene that the camera sees at each sample of its picture.

    Triangles are seen from both sides. Surfaces of alpha mode MASK are seen through where their alpha is
    below the cutoff; BLEND is drawn as opaque, except where its alpha rounds to 0 in 8 bits. Where coincident
    triangles tie, the lowest index wins. Triangles without area are not seen.

    Parameters
    ----------
    samples_per_pixel
        1 samples pixel centres and gives arrays `(h, w, ...)`; more give `(h, w, s, ...)`, at places within
        the pixel that are the same for all. Rows go from the top of the picture downwards.
    clock
        Hears how far the work has come.

    Raises
    ------
    OptionError
        When `samples_per_pixel` is not a whole number from 1.
    CapacityError
        When the result would not fit into memory.
    """
    instance(scene, Scene, "scene")
    instance(camera, Camera, "camera")
    if not isinstance(samples_per_pixel, (int, np.integer)) or samples_per_pixel < 1:
        raise OptionError(f"samples_per_pixel: wanted a whole number from 1, got {samples_per_pixel!r}")
    per_pixel, width, height = int(samples_per_pixel), camera.width, camera.height
    total = width * height * per_pixel
    require(
        total * _BYTES_PER_SAMPLE + len(scene.positions) * 24 + len(scene.triangles) * 16,
        f"a picture of {width} x {height} pixels with {per_pixel} samples each",
    )
    picture = Picture(width, height, camera.near, *pixel_offsets(per_pixel))
    geometry = project(scene, camera)
    surface = _surface(scene)
    band_rows = max(1, min(_BAND_ROWS, _BAND_SAMPLES // (width * per_pixel)))
    begin, listed = list_by_band(geometry, picture, band_rows)

    triangle = np.empty(total, np.int32)
    barycentric = np.empty((total, 2), np.float32)
    side = np.empty(total, np.int8)
    position = np.empty((total, 3), np.float32)
    depth = np.empty(total, np.float32)

    def band(index: int) -> None:
        top, bottom = index * band_rows, min((index + 1) * band_rows, height)
        part = slice(top * width * per_pixel, bottom * width * per_pixel)
        nearest = np.full(part.stop - part.start, np.inf)
        triangle[part], side[part] = -1, 0
        ids = listed[begin[index] : begin[index + 1]]
        _draw(geometry, ids, picture, surface, top, bottom, nearest, triangle[part], side[part])
        _resolve(geometry, picture, top, bottom, triangle[part], barycentric[part], position[part])
        depth[part] = nearest

    run(band, len(begin) - 1, clock)
    shape = (height, width) if per_pixel == 1 else (height, width, per_pixel)
    return ViewSamples(
        triangle=triangle.reshape(shape),
        barycentric=barycentric.reshape(*shape, 2),
        side=side.reshape(shape),
        position=position.reshape(*shape, 3),
        covered=(triangle >= 0).reshape(shape),
        depth=depth.reshape(shape),
        camera=camera,
    )


def _surface(scene: Scene) -> _Surface:
    def rows(values: NDArray[np.float32] | None, width: int) -> NDArray[np.float32]:
        if values is not None:
            return values
        none = np.zeros((0, width), np.float32)
        none.flags.writeable = False  # as the scene's own arrays: to Numba it is part of the type
        return none

    cutoff = np.array([_cutoff(material) for material in scene.materials])
    return _Surface(
        scene.material_id,
        cutoff,
        np.array([material.base_color[3] for material in scene.materials]),
        rows(scene.uv, 2),
        rows(scene.colors, 4),
        pack(
            [
                m.texture if cut >= 0 and scene.uv is not None else None
                for m, cut in zip(scene.materials, cutoff, strict=True)
            ]
        ),
    )


def _cutoff(material: Material) -> float:
    """Alpha below which there is nothing to be seen; -1 for opaque surfaces."""
    return {"OPAQUE": -1.0, "MASK": material.alpha_cutoff, "BLEND": 0.5 / 255}[material.alpha_mode]


@inline
def _seen_through(geometry: Geometry, surface: _Surface, t: int, x: float, y: float) -> bool:
    """Whether the triangle, which is not opaque, has a hole at sample (x, y)."""
    a, b, c = corners(geometry, t)
    wb, wc = weights(a, b, c, x, y)
    wa = 1.0 - wb - wc
    i, j, k = geometry.triangles[t, 0], geometry.triangles[t, 1], geometry.triangles[t, 2]
    material = surface.material_id[t]
    alpha = surface.alpha[material]
    if len(surface.colors) > 0:
        alpha *= wa * surface.colors[i, 3] + wb * surface.colors[j, 3] + wc * surface.colors[k, 3]
    if surface.textures.offset[material] >= 0:
        u = wa * surface.uv[i, 0] + wb * surface.uv[j, 0] + wc * surface.uv[k, 0]
        v = wa * surface.uv[i, 1] + wb * surface.uv[j, 1] + wc * surface.uv[k, 1]
        textures = surface.textures
        alpha *= fetch(textures.texels, textures.offset, textures.size, material, u, v)[3]
    return bool(alpha < surface.cutoff[material])


@inline
def _narrow(a: float, rest: float, bound: float, offset: float, first: int, last: int) -> tuple[int, int]:
    """Drop columns where `a x + rest` is certainly below `-bound`.

    Twice the bound leaves room for the rounding of the numerator, a thousandth of a pixel for that of the
    quotient (2**-36 for quotients below 2**17; those beyond lie outside of the picture either way).
    """
    if a > 0.0:
        at = (-2.0 * bound - rest) / a - offset - 1e-3
        if at > first:
            first = math.ceil(min(at, last + 1.0))
    elif a < 0.0:
        at = (-2.0 * bound - rest) / a - offset + 1e-3
        if at < last:
            last = math.floor(max(at, first - 1.0))
    elif rest < -bound:
        last = first - 1
    return first, last


@kernel
def _draw(
    geometry: Geometry,
    ids: NDArray[np.int32],
    picture: Picture,
    surface: _Surface,
    top: int,
    bottom: int,
    nearest: NDArray[np.float64],
    triangle: NDArray[np.int32],
    side: NDArray[np.int8],
) -> None:
    """Draw a band's triangles into its depth buffer, rows `top` to `bottom` (excluded)."""
    width, height, per_pixel = picture.width, picture.height, len(picture.x)
    for t in ids:
        p, q, r = corners(geometry, t)
        s = orientation(p, q, r)
        seen_side = -s
        # Vertices in order of their place: coincident triangles of any winding get bitwise equal depths.
        if q < p:
            p, q, s = q, p, -s
        if r < q:
            q, r, s = r, q, -s
        if q < p:
            p, q, s = q, p, -s
        if s == 0:
            continue
        # Edge functionals a x + b y + c, made positive inside; e0 is opposite to p.
        a0, b0, c0 = (
            s * (q[1] * r[2] - q[2] * r[1]),
            s * (q[2] * r[0] - q[0] * r[2]),
            s * (q[0] * r[1] - q[1] * r[0]),
        )
        a1, b1, c1 = (
            s * (r[1] * p[2] - r[2] * p[1]),
            s * (r[2] * p[0] - r[0] * p[2]),
            s * (r[0] * p[1] - r[1] * p[0]),
        )
        a2, b2, c2 = (
            s * (p[1] * q[2] - p[2] * q[1]),
            s * (p[2] * q[0] - p[0] * q[2]),
            s * (p[0] * q[1] - p[1] * q[0]),
        )
        most_x = max(abs(p[0]), abs(q[0]), abs(r[0]))
        most_y = max(abs(p[1]), abs(q[1]), abs(r[1]))
        most_w = max(abs(p[2]), abs(q[2]), abs(r[2]))
        bound = FILTER * 2.0 * (most_w * (most_y * width + most_x * height) + most_x * most_y)
        masked = surface.cutoff[surface.material_id[t]] >= 0.0
        first_column, last_column = geometry.boxes[t, 2], geometry.boxes[t, 3]
        wide = last_column - first_column >= _WIDE
        for row in range(max(top, geometry.boxes[t, 0]), min(bottom - 1, geometry.boxes[t, 1]) + 1):
            for k in range(per_pixel):
                y = row + picture.y[k]
                rest0, rest1, rest2 = b0 * y + c0, b1 * y + c1, b2 * y + c2
                first, last = first_column, last_column
                if wide:
                    first, last = _narrow(a0, rest0, bound, picture.x[k], first, last)
                    first, last = _narrow(a1, rest1, bound, picture.x[k], first, last)
                    first, last = _narrow(a2, rest2, bound, picture.x[k], first, last)
                for column in range(first, last + 1):
                    x = column + picture.x[k]
                    e0, e1, e2 = a0 * x + rest0, a1 * x + rest1, a2 * x + rest2
                    least = min(e0, e1, e2)
                    if least < -bound:
                        continue
                    if not least > bound:
                        if not covers(p, q, r, s, (x, y, 1.0)):
                            continue
                        e0, e1, e2 = max(e0, 0.0), max(e1, 0.0), max(e2, 0.0)
                    w = p[2]
                    if e1 + e2 > 0.0:
                        w += (e1 * (q[2] - p[2]) + e2 * (r[2] - p[2])) / (e0 + e1 + e2)
                    at = ((row - top) * width + column) * per_pixel + k
                    if w < nearest[at] and w >= picture.near:
                        if masked and _seen_through(geometry, surface, t, x, y):
                            continue
                        nearest[at] = w
                        triangle[at] = t
                        side[at] = seen_side


@kernel
def _resolve(
    geometry: Geometry,
    picture: Picture,
    top: int,
    bottom: int,
    triangle: NDArray[np.int32],
    barycentric: NDArray[np.float32],
    position: NDArray[np.float32],
) -> None:
    """Turn the triangles that won in a band into points on them; zeros for background."""
    positions, triangles = geometry.positions, geometry.triangles
    at = 0
    for row in range(top, bottom):
        for column in range(picture.width):
            for k in range(len(picture.x)):
                u, v = 0.0, 0.0
                t = triangle[at]
                if t >= 0:
                    a, b, c = corners(geometry, t)
                    u, v = weights(a, b, c, column + picture.x[k], row + picture.y[k])
                    u = np.rint(u * _QUANTA) / _QUANTA
                    v = min(np.rint(v * _QUANTA) / _QUANTA, 1.0 - u)
                    for axis in range(3):
                        from_a = np.float64(positions[triangles[t, 0], axis])
                        to_b = positions[triangles[t, 1], axis] - from_a
                        to_c = positions[triangles[t, 2], axis] - from_a
                        position[at, axis] = from_a + u * to_b + v * to_c
                else:
                    position[at, 0], position[at, 1], position[at, 2] = 0.0, 0.0, 0.0
                barycentric[at, 0], barycentric[at, 1] = u, v
                at += 1
