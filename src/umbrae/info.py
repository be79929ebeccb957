"""What a model consists of, and what that means for its shadows."""

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from umbrae.geometry.edges import edges, silhouette_share, weld, zero_area
from umbrae.scene import Scene

PICTURE_PX = 1920 * 1080
"""The picture that the memory estimate is for."""

FAR_DIGITS = 10
"""Digits of coordinates far from zero: millimetres of a georeferenced model."""

_BYTES_PER_SAMPLE = 4 + 8 + 1 + 12 + 1 + 4 + 1
"""Triangle, barycentrics, side, position, covered and depth of a view sample, and its verdict."""


@dataclass(frozen=True)
class MaterialInfo:
    """One material of a model; `texture_px` is width and height, `triangles` how many use it."""

    name: str
    base_color: tuple[float, float, float, float]
    alpha_mode: str
    transmission: float
    double_sided: bool
    texture_px: tuple[int, int] | None
    triangles: int


@dataclass(frozen=True)
class ModelInfo:
    """A model in numbers. Vertices with the same position count as one, whatever the indices say.

    Attributes
    ----------
    triangles, vertices, positions
        Number of triangles, of vertices as stored, and of different positions among them.
    edges_1, edges_2, edges_more
        Number of edges along which one, two or more triangles meet.
    closed
        Whether an even number of triangles meets along every edge: nothing has a border.
    edges_badly_wound
        Edges along which windings disagree: the directions of the triangles that meet there do not cancel,
        not even up to the one that is left over when their number is odd.
    degenerate
        Triangles that have exactly no area and so cast no shadow.
    duplicates
        Triangles whose three positions another triangle before them has already.
    bounds, origin
        Lower and upper corner in the file's coordinates; what is subtracted from them to compute near zero.
    scene_bytes, samples_bytes
        Memory for the scene's arrays and textures, and for the samples and mask of a 1920x1080 picture.
    silhouette_share
        Share of the edges that are silhouettes, averaged over `light_grid`. The lower, the more it pays to
        draw shadow volumes from silhouettes instead of triangle by triangle.
    """

    triangles: int
    vertices: int
    positions: int
    edges_1: int
    edges_2: int
    edges_more: int
    closed: bool
    edges_badly_wound: int
    degenerate: int
    duplicates: int
    bounds: tuple[tuple[float, ...], tuple[float, ...]]
    origin: tuple[float, ...]
    scene_bytes: int
    samples_bytes: int
    silhouette_share: float
    materials: tuple[MaterialInfo, ...]

    @property
    def consistently_wound(self) -> bool:
        """Whether neighbours agree which of their sides is the front."""
        return self.edges_badly_wound == 0

    def as_dict(self) -> dict[str, Any]:
        """All of it as plain numbers, texts, lists and dictionaries."""
        return dataclasses.asdict(self) | {"consistently_wound": self.consistently_wound}


def describe(scene: Scene) -> ModelInfo:
    """Count what a scene consists of."""
    ids = weld(scene.positions)
    welded = ids[scene.triangles]
    topology = edges(welded)
    count, balance = topology.count, topology.balance
    lower, upper = (tuple((corner + scene.origin).tolist()) for corner in scene.bounds.astype(np.float64))
    return ModelInfo(
        triangles=len(scene.triangles),
        vertices=len(scene.positions),
        positions=len(np.unique(ids)),
        edges_1=int((count == 1).sum()),
        edges_2=int((count == 2).sum()),
        edges_more=int((count > 2).sum()),
        closed=bool((count % 2 == 0).all()),
        edges_badly_wound=int((np.abs(balance) > count % 2).sum()),
        degenerate=int(zero_area(scene.positions, scene.triangles).sum()),
        duplicates=_duplicates(welded),
        bounds=(lower, upper),
        origin=tuple(scene.origin.tolist()),
        scene_bytes=_scene_bytes(scene),
        samples_bytes=PICTURE_PX * _BYTES_PER_SAMPLE,
        silhouette_share=silhouette_share(scene.positions, scene.triangles, topology, light_grid(scene)),
        materials=_materials(scene),
    )


def light_grid(scene: Scene) -> NDArray[np.float64]:
    """`(64, 4)` point lights inside and around a scene: 4 x 4 x 4 over a cube of twice its largest extent."""
    lower, upper = scene.bounds.astype(np.float64)
    steps = np.array([-0.75, -0.25, 0.25, 0.75]) * 2.0 * float((upper - lower).max())
    offsets = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    return np.concatenate([(lower + upper) / 2 + offsets, np.ones((len(offsets), 1))], axis=1)


def table(info: ModelInfo) -> Table:
    """The numbers for a terminal of 80 columns."""
    lower, upper = info.bounds
    digits = FAR_DIGITS if any(info.origin) else 6
    rows = Table(box=None, show_header=False, pad_edge=False)
    rows.add_column(no_wrap=True, style="bold")
    rows.add_column(overflow="fold")
    for name, value in (
        ("triangles", f"{info.triangles:,}"),
        ("vertices", f"{info.vertices:,} at {info.positions:,} positions"),
        (
            "edges",
            f"{info.edges_1:,} with one triangle, {info.edges_2:,} with two, {info.edges_more:,} with more",
        ),
        ("closed", "yes" if info.closed else "no"),
        (
            "winding",
            "consistent" if info.consistently_wound else f"disagrees on {info.edges_badly_wound:,} edges",
        ),
        ("silhouettes", f"{info.silhouette_share:.1%} of the edges, on average over 64 lights"),
        ("degenerate", f"{info.degenerate:,} triangles"),
        ("duplicates", f"{info.duplicates:,} triangles"),
        ("bounds", f"{triple(lower, digits)} to {triple(upper, digits)}"),
        *((("origin", triple(info.origin, digits)),) if any(info.origin) else ()),
        (
            "memory",
            f"{_mib(info.scene_bytes)} for the scene, {_mib(info.samples_bytes)} for 1920x1080 samples",
        ),
        ("materials", f"{len(info.materials):,}"),
        *((f"  {material.name or '(no name)'}"[:24], _material_line(material)) for material in info.materials),
    ):
        rows.add_row(name, value)
    return rows


def _duplicates(welded: NDArray[np.int32]) -> int:
    if len(welded) == 0:
        return 0
    a, b, c = np.sort(welded, axis=1).T
    order = np.lexsort((c, b, a))
    return int(np.logical_and.reduce([np.diff(ids[order]) == 0 for ids in (a, b, c)]).sum())


def _scene_bytes(scene: Scene) -> int:
    textures = {id(m.texture): m.texture for m in scene.materials}.values()
    arrays = (scene.positions, scene.triangles, scene.material_id, scene.object_id)
    optional = (scene.normals, scene.uv, scene.colors, *textures)
    return sum(array.nbytes for array in (*arrays, *optional) if array is not None)


def _materials(scene: Scene) -> tuple[MaterialInfo, ...]:
    used = np.bincount(scene.material_id, minlength=len(scene.materials))
    return tuple(
        MaterialInfo(
            name=material.name,
            base_color=material.base_color,
            alpha_mode=material.alpha_mode,
            transmission=material.transmission,
            double_sided=material.double_sided,
            texture_px=None if material.texture is None else (material.texture.shape[1], material.texture.shape[0]),
            triangles=int(count),
        )
        for material, count in zip(scene.materials, used, strict=True)
    )


def _material_line(material: MaterialInfo) -> str:
    parts = [f"{material.triangles:,} triangles", " ".join(f"{part:.2g}" for part in material.base_color)]
    if material.texture_px is not None:
        parts.append("texture {}x{}".format(*material.texture_px))
    if material.alpha_mode != "OPAQUE":
        parts.append(material.alpha_mode.lower())
    if material.transmission > 0:
        parts.append(f"transmission {material.transmission:.2g}")
    if not material.double_sided:
        parts.append("single-sided")
    return ", ".join(parts)


def triple(numbers: Iterable[float], digits: int) -> str:
    """`(x, y, z)` for a terminal."""
    return "({})".format(", ".join(f"{number:.{digits}g}" for number in numbers))


def _mib(size: int) -> str:
    return f"{size / 2**20:,.1f} MiB"
