"""The geometry that casts and receives shadows: an arbitrary triangle soup."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbrae.checks import array, instance, number, vector
from umbrae.errors import InputError, RecentredWarning
from umbrae.geometry.smoothing import smoothing_groups
from umbrae.material import Material

_FAR_FROM_ZERO = 16.0
"""Recentre when the largest coordinate exceeds this many times the extent: 4 of float32's 24 bits would be lost."""


class Family:
    """What a scene has in common with its moved copies: caches of what does not depend on positions hang on to it."""


@dataclass(frozen=True, eq=False, init=False)
class Scene:
    """Triangles with materials. Nothing about manifoldness, winding or closedness is promised or needed.

    Parameters
    ----------
    positions
        `(v, 3)` vertex positions in world units; stored as float32. Coordinates given with more precision than
        float32 and lying far from zero (a georeferenced model) are recentred in float64 first: `origin` holds what
        was subtracted, `RecentredWarning` says so. Everything else (lights, cameras, points) is given in the
        scene's coordinates; `local` converts to them.
    triangles
        `(t, 3)` vertex indices; stored as int32. May be empty.
    materials
        One or more `Material`; one neutral grey by default.
    material_id
        `(t,)` index into `materials` per triangle; 0 by default.
    normals
        `(v, 3)` smooth normals for shading; the facets' own by default. Zero rows fall back to the facet.
    uv
        `(v, 2)` texture coordinates, (0, 0) at the top left corner of the image as in glTF.
    colors
        `(v, 4)` linear vertex colours in [0, 1] that multiply the base colour.
    object_id
        `(t,)` object each triangle belongs to; 0 by default.
    origin
        `(3,)` float64 world position of the coordinate system's zero.

    Attributes
    ----------
    family
        The same object for this scene and all that `moved` makes of it.

    Raises
    ------
    InputError
        For arrays of a wrong shape, coordinates that are not finite or exceed 1e18 (products of them must stay
        finite in float64), or indices out of range.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    materials: tuple[Material, ...]
    material_id: NDArray[np.int32]
    normals: NDArray[np.float32] | None
    uv: NDArray[np.float32] | None
    colors: NDArray[np.float32] | None
    object_id: NDArray[np.int32]
    origin: NDArray[np.float64]
    family: Family = field(init=False)

    def __init__(
        self,
        positions: ArrayLike,
        triangles: ArrayLike,
        materials: Sequence[Material] = (),
        material_id: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        uv: ArrayLike | None = None,
        object_id: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        origin: ArrayLike | None = None,
    ) -> None:
        points = _rows(positions, 3, "positions")
        indices = array(triangles, "Scene.triangles")
        if indices.size == 0:
            indices = np.zeros((0, 3), np.int32)
        if indices.ndim != 2 or indices.shape[1] != 3 or not np.issubdtype(indices.dtype, np.integer):
            raise InputError(f"Scene.triangles: wanted (t, 3) integers, got {indices.shape} {indices.dtype}")
        vertices, count = len(points), len(indices)
        if count and (indices.min() < 0 or indices.max() >= vertices):
            bad = int(np.flatnonzero(((indices < 0) | (indices >= vertices)).any(axis=1))[0])
            raise InputError(
                f"Scene.triangles: triangle {bad} has indices {indices[bad].tolist()}, wanted 0 to {vertices - 1}"
            )
        zero = np.zeros(3) if origin is None else vector(origin, "Scene.origin")
        points, shift = _recentre(points)
        if shift.any():
            warnings.warn(
                f"coordinates far from zero: moved by {(-shift).tolist()} (see Scene.origin); give lights, cameras "
                "and points in the scene's coordinates, Scene.local converts",
                RecentredWarning,
                stacklevel=2,
            )
        palette = (materials,) if isinstance(materials, Material) else tuple(materials or (Material(),))
        for material in palette:
            instance(material, Material, "Scene.materials")
        ids = _per_triangle(material_id, count, "material_id")
        if count and (ids.min() < 0 or ids.max() >= len(palette)):
            raise InputError(
                f"Scene.material_id: wanted 0 to {len(palette) - 1}, got {int(ids.min())} to {int(ids.max())}"
            )
        put = object.__setattr__
        put(self, "positions", _frozen(points.astype(np.float32)))
        put(self, "triangles", _frozen(indices.astype(np.int32)))
        put(self, "materials", palette)
        put(self, "material_id", _frozen(ids))
        put(self, "normals", _per_vertex(normals, vertices, 3, "normals"))
        put(self, "uv", _per_vertex(uv, vertices, 2, "uv"))
        put(self, "colors", _per_vertex(colors, vertices, 4, "colors"))
        if self.colors is not None and self.colors.size and not 0 <= self.colors.min() <= self.colors.max() <= 1:
            low, high = float(self.colors.min()), float(self.colors.max())
            raise InputError(f"Scene.colors: wanted numbers in [0, 1], got {low:g} to {high:g}")
        put(self, "object_id", _frozen(_per_triangle(object_id, count, "object_id")))
        put(self, "origin", _frozen(zero + shift))
        put(self, "family", Family())

    @classmethod
    def from_trimesh(cls, mesh: Any) -> "Scene":
        """Make a scene of a `trimesh.Trimesh` or `trimesh.Scene`, with the materials trimesh knows."""
        from umbrae.files import scene_from_trimesh

        return scene_from_trimesh(mesh)

    @cached_property
    def bounds(self) -> NDArray[np.float32]:
        """`(2, 3)` lower and upper corner of the vertices that triangles use; zeros for an empty scene."""
        if len(self.triangles) == 0:
            return _frozen(np.zeros((2, 3), np.float32))
        used = np.zeros(len(self.positions), bool)
        used[self.triangles.reshape(-1)] = True
        points = self.positions[used]
        return _frozen(np.stack([points.min(axis=0), points.max(axis=0)]))

    def moved(self, positions: ArrayLike, normals: ArrayLike | None = None) -> "Scene":
        """The same triangles with their vertices elsewhere; everything else is shared, not copied.

        Parameters
        ----------
        positions
            `(v, 3)` in the scene's own coordinates, which stay where they are: they are never recentred.
        normals
            `(v, 3)` those that belong to them; by default the scene's, as they are.

        Raises
        ------
        InputError
            For arrays of another shape, or coordinates that a scene does not take.
        """
        points = _rows(positions, 3, "positions").astype(np.float32)
        if len(points) != len(self.positions):
            raise InputError(f"Scene.positions: wanted {len(self.positions)} rows, one per vertex, got {len(points)}")
        made = object.__new__(Scene)
        shared = {field.name: getattr(self, field.name) for field in fields(self)}
        made.__dict__.update(shared | {"positions": _frozen(points)})
        if normals is not None:
            made.__dict__["normals"] = _per_vertex(normals, len(self.positions), 3, "normals")
        return made

    def opaque(self) -> "Scene":
        """The same scene with every material opaque: no holes, nothing seen through, nothing lets light through."""
        if all(material.casts_solid for material in self.materials):
            return self
        solid = [replace(material, alpha_mode="OPAQUE", transmission=0.0) for material in self.materials]
        return Scene(
            self.positions,
            self.triangles,
            solid,
            self.material_id,
            self.normals,
            self.uv,
            self.object_id,
            self.colors,
            self.origin,
        )

    def smoothed(self, crease: float = 45.0) -> "Scene":
        """The same scene with vertex normals made anew from its facets.

        Parameters
        ----------
        crease
            Degrees from 0 to 180: an edge whose facets turn by more, and one of any other number of triangles than two,
            keeps a normal for each side. Vertices there are repeated, so `positions` has other rows.

        Raises
        ------
        InputError
            For any other angle.
        """
        if not 0.0 <= number(crease, "Scene.smoothed: crease") <= 180.0:
            raise InputError(f"Scene.smoothed: crease: wanted degrees from 0 to 180, got {crease}")
        group, normals = smoothing_groups(self.positions, self.triangles, math.cos(math.radians(crease)))
        pairs = np.stack([self.triangles.astype(np.int64), group], axis=-1).reshape(-1, 2)
        vertices, corner = np.unique(pairs, axis=0, return_inverse=True)
        kept = vertices[:, 0]
        return Scene(
            self.positions[kept],
            corner.reshape(-1, 3),
            self.materials,
            self.material_id,
            normals[vertices[:, 1]],
            None if self.uv is None else self.uv[kept],
            self.object_id,
            None if self.colors is None else self.colors[kept],
            self.origin,
        )

    def local(self, world: ArrayLike) -> NDArray[np.float64]:
        """World coordinates `(..., 3)` in the scene's own coordinates: minus `origin`, in float64."""
        return np.asarray(world, np.float64) - self.origin

    def __repr__(self) -> str:
        return f"Scene({len(self.triangles)} triangles, {len(self.positions)} vertices)"


def _rows(values: ArrayLike, width: int, name: str) -> NDArray[Any]:
    rows = array(values, f"Scene.{name}")
    if rows.size == 0:
        rows = np.zeros((0, width), np.float32)
    if rows.ndim != 2 or rows.shape[1] != width or rows.dtype.kind not in "iuf":
        raise InputError(f"Scene.{name}: wanted (n, {width}) numbers, got {rows.shape} {rows.dtype}")
    if rows.dtype != np.float32:
        rows = rows.astype(np.float64)
    if not np.isfinite(rows).all():
        bad = int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])
        raise InputError(f"Scene.{name}: row {bad} is {rows[bad].tolist()}, wanted finite numbers")
    if rows.size and np.abs(rows).max() > 1e18:
        raise InputError(f"Scene.{name}: wanted magnitudes up to 1e18, got {float(np.abs(rows).max()):g}")
    return rows


def _recentre(points: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Points moved near zero where float32 would lose their digits, and by how much.

    Only where digits would really be lost: float32 input, and float64 input that float32 holds exactly, stay put.
    """
    stay = np.zeros(3)
    if points.dtype == np.float32 or len(points) == 0 or (points.astype(np.float32) == points).all():
        return points, stay
    low, high = points.min(axis=0), points.max(axis=0)
    if np.abs(points).max() <= _FAR_FROM_ZERO * (high - low).max():
        return points, stay
    shift = np.round((low + high) / 2)
    return points - shift, shift


def _per_vertex(values: ArrayLike | None, count: int, width: int, name: str) -> NDArray[np.float32] | None:
    if values is None:
        return None
    rows = _rows(values, width, name)
    if len(rows) != count:
        raise InputError(f"Scene.{name}: wanted {count} rows, one per vertex, got {len(rows)}")
    return _frozen(rows.astype(np.float32))


def _per_triangle(values: ArrayLike | None, count: int, name: str) -> NDArray[np.int32]:
    if values is None:
        return np.zeros(count, np.int32)
    ids = array(values, f"Scene.{name}")
    if ids.shape != (count,) or (count and not np.issubdtype(ids.dtype, np.integer)):
        raise InputError(f"Scene.{name}: wanted ({count},) integers, got {ids.shape} {ids.dtype}")
    held = ids.astype(np.int32)
    if (held != ids).any():
        raise InputError(f"Scene.{name}: wanted integers that int32 holds, got {ids[held != ids][0]}")
    return held


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """A contiguous array that can no longer be written to, never the caller's own."""
    own = np.array(array, order="C", copy=True)
    own.flags.writeable = False
    return own
