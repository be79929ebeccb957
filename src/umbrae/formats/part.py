"""Pieces of a model and how they become one scene."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import ModelError
from umbrae.geometry.transforms import transformed
from umbrae.material import Material
from umbrae.scene import Scene


@dataclass(eq=False)
class Part:
    """Triangles of one object and one material, in world coordinates.

    `positions (v, 3) float64`, `triangles (t, 3)`, optional `normals (v, 3)`, `uv (v, 2)` and linear
    `colors (v, 4)`. `rows (v,)` are the rows of the file that vertices were read from; None for all of them.
    """

    positions: NDArray[np.float64]
    triangles: NDArray[np.int64]
    material: Material
    object_id: int = 0
    normals: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None
    colors: NDArray[np.float64] | None = None
    rows: NDArray[np.intp] | None = None

    def placed(self, matrix: NDArray[np.float64], object_id: int) -> "Part":
        """A copy under a `(4, 4)` transform, in float64; a mirror image keeps its outer side outside."""
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        positions, normals = transformed(self.positions, self.normals, matrix)
        triangles = self.triangles[:, ::-1] if mirrored else self.triangles
        return replace(self, positions=positions, triangles=triangles, object_id=object_id, normals=normals)

    def compact(self) -> "Part":
        """The same triangles without vertices that none of them uses."""
        used = np.zeros(len(self.positions), bool)
        used[self.triangles] = True
        if used.all():
            return self
        normals, uv, colors = (None if rows is None else rows[used] for rows in (self.normals, self.uv, self.colors))
        renumbered = np.cumsum(used) - 1
        return Part(
            self.positions[used],
            renumbered[self.triangles],
            self.material,
            self.object_id,
            normals,
            uv,
            colors,
            np.flatnonzero(used),
        )


def joined(parts: Sequence[Part]) -> Scene:
    """All parts as one scene; equal materials become one.

    Attributes that only some parts have are filled with what changes nothing: zero normals (the facet's own),
    white. Rows of attributes that are not finite count as absent; positions that are not finite are an error.
    """
    parts = [part for part in parts if len(part.triangles)]
    if not parts:
        raise ModelError("has no triangles")
    starts = np.cumsum([0] + [len(part.positions) for part in parts])
    counts = [len(part.triangles) for part in parts]
    materials: dict[tuple[object, ...], tuple[int, Material]] = {}
    material_id = [materials.setdefault(_identity(part.material), (len(materials), part.material))[0] for part in parts]
    return Scene(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=False)]),
        materials=[material for _, material in materials.values()],
        material_id=np.repeat(material_id, counts),
        object_id=np.repeat([part.object_id for part in parts], counts),
        normals=_attribute([part.normals for part in parts], parts, 3, 0.0),
        uv=_attribute([part.uv for part in parts], parts, 2, 0.0),
        colors=_attribute([part.colors for part in parts], parts, 4, 1.0),
    )


def _attribute(
    arrays: list[NDArray[np.float64] | None], parts: list[Part], width: int, absent: float
) -> NDArray[np.float32] | None:
    if all(array is None for array in arrays):
        return None
    rows = np.full((sum(len(part.positions) for part in parts), width), absent, np.float32)
    start = 0
    for array, part in zip(arrays, parts, strict=True):
        end = start + len(part.positions)
        if array is not None:
            finite = (np.abs(array) <= 1e18).all(axis=1, keepdims=True)
            np.copyto(rows[start:end], array, where=finite, casting="same_kind")
        start = end
    return rows


def _identity(material: Material) -> tuple[object, ...]:
    return (
        material.base_color,
        material.alpha_mode,
        material.alpha_cutoff,
        material.transmission,
        id(material.texture),
        material.double_sided,
        material.name,
    )
