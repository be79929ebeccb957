"""Surfaces that are seen through where their alpha is too low."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.texture import Textures, fetch, pack
from umbrae.material import Material
from umbrae.parallel import inline
from umbrae.sampling.bands import Geometry, corners
from umbrae.sampling.coverage import weights
from umbrae.scene import Scene


class Surface(NamedTuple):
    """What decides whether an alpha-masked surface is seen through."""

    material_id: NDArray[np.int32]
    cutoff: NDArray[np.float64]  # per material, -1 if opaque
    alpha: NDArray[np.float64]  # per material, of the base colour
    uv: NDArray[np.float32]  # (0, 2) if the scene has none
    colors: NDArray[np.float32]  # (0, 4) if the scene has none
    textures: Textures


def surface_of(scene: Scene) -> Surface:
    """A scene's surface as kernels want it."""

    def rows(values: NDArray[np.float32] | None, width: int) -> NDArray[np.float32]:
        if values is not None:
            return values
        none = np.zeros((0, width), np.float32)
        none.flags.writeable = False  # as the scene's own arrays: to Numba it is part of the type
        return none

    cutoff = np.array([_cutoff(material) for material in scene.materials])
    return Surface(
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
def seen_through(geometry: Geometry, surface: Surface, t: int, x: float, y: float) -> bool:
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
