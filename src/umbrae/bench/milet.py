"""The tables of Milet, Kobrtek, Zemcik and Peciva ("Fast and Robust Tessellation-Based Silhouette Shadows")."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from umbrae import models
from umbrae.bench import milet_paper as paper
from umbrae.bench.by_object import GsByObject, TsByObject
from umbrae.bench.case import View
from umbrae.bench.milet_paper import GS, GS_3, GS_TRIANGLE, OPENGL, SM, TS, TS_3, TS_TRIANGLE
from umbrae.bench.milet_scenes import (
    SPHERES_SECONDS,
    SPONZA_SECONDS,
    Grid,
    box_and_sphere,
    facing_views,
    grid_of,
    spheres_views,
    sponza_views,
    without_textures,
)
from umbrae.bench.scenes import SCENES
from umbrae.bench.sweep import TIME, Cell, PaperRow, Quantity, Sweep, SweepRecord
from umbrae.bench.sweep_run import Column, run_sweep
from umbrae.clock import Clock
from umbrae.methods import Method, make_method
from umbrae.scene import Scene

CHECKED = 2_000
"""Samples of the last frame that each row's mask is held against the oracle in."""
SOURCE = "Milet, Kobrtek, Zemcik, Peciva, Table"
SIZE, QUICK_SIZE = (800, 600), (400, 300)
"""Pixels where the paper does not tell them, and in short."""
QUICK_FRAMES, QUICK_TRIANGLES = 3, 110_000

AS_THEIRS = (
    "TS and GS are silhouette-ts and silhouette-gs as the paper has them: z-fail, a stencil, nothing culled; "
    "'3 edges' is the older determinism, which promises nothing. Time is that of the shadows, their samples given; "
    "the paper's is that of a whole frame, without the way to the card and back. "
)


@dataclass(frozen=True)
class Effort:
    """How much of a table is measured.

    Attributes
    ----------
    full
        All of the paper's columns, at its sizes, a frame for each second of its flights; else what takes minutes on a
        software driver.
    frames
        Along each flight, if not those.
    most
        Triangles of the largest scene of spheres, if not those.
    """

    full: bool = False
    frames: int | None = None
    most: int | None = None

    def count(self, seconds: int) -> int:
        """Frames of a flight of so many seconds."""
        return self.frames or (seconds if self.full else QUICK_FRAMES)

    @property
    def size(self) -> tuple[int, int]:
        """Pixels, where the paper tells none."""
        return SIZE if self.full else QUICK_SIZE

    def fits(self, triangles: int) -> bool:
        """Whether a scene of spheres is small enough."""
        return triangles <= (self.most or (1 << 62 if self.full else QUICK_TRIANGLES))


def as_paper(name: str, **options: Any) -> Method:
    """A shadow volume method the way that the paper uses it."""
    return make_method(name, counting="zfail", counter="stencil", culling=False, **options)


def silhouettes() -> dict[str, Method]:
    """The paper's two methods with its two determinisms."""
    return {
        TS: as_paper("silhouette-ts"),
        TS_3: as_paper("silhouette-ts", determinism="three-edge"),
        GS: as_paper("silhouette-gs"),
        GS_3: as_paper("silhouette-gs", determinism="three-edge"),
    }


def run_resolution(folder: Path | None, effort: Effort, clock: Clock) -> SweepRecord:
    """Table 1: Sponza at four sizes, the smaller two in short."""
    names = paper.columns_of(paper.RESOLUTION)[: None if effort.full else 2]
    load = _sponza(folder)

    def column(name: str) -> Column:
        width, height = map(int, name.split("x"))
        views = _along_sponza(effort, (width, height))
        return Column(name, load, views, {**silhouettes(), "frustum": make_method("frustum")})

    sweep = _sweep(
        "milet-resolution", "Sponza at different resolutions", "1", "resolution", names, paper.rows_of(paper.RESOLUTION)
    )
    return run_sweep(sweep, [column(name) for name in names], CHECKED, clock)


def run_textures(folder: Path | None, effort: Effort, clock: Clock) -> SweepRecord:
    """Table 2: whole pictures of Sponza with textures and without."""
    load, size = _sponza(folder), effort.size
    views, rows = _along_sponza(effort, size), silhouettes()
    columns = [
        Column("tex", load, views, rows, picture=True),
        Column("notex", lambda: without_textures(load()), views, rows, picture=True),
    ]
    note = (
        "Here the time is that of the whole picture: samples and shading on the CPU, shadows between them. Textures "
        "are looked up in shading alone, no method of shadows sees them: OpenGL's part must be the same in both."
    )
    rows_told = paper.rows_of(paper.TEXTURES)
    sweep = _sweep(
        "milet-textures", "Sponza with textures and without", "2", "variant", ["tex", "notex"], rows_told, size, note
    )
    return run_sweep(sweep, columns, CHECKED, clock)


SPHERE_SCENES = {"10x10": paper.SPHERES, "box": paper.BOX}


def run_spheres(names: Sequence[str], effort: Effort, clock: Clock) -> SweepRecord:
    """Tables 3 and 4: a hundred spheres, or one over a box, of ever more triangles."""

    def column(name: str, triangles: int) -> Column:
        grid = (1, 1) if name == "box" else (10, 10)
        scene = partial(box_and_sphere if name == "box" else partial(models.spheres, grid), triangles)
        rows = {**silhouettes(), "frustum": make_method("frustum")}
        return Column(f"{name} {triangles}", scene, _around(grid, effort), rows)

    columns: list[Column] = []
    told: tuple[PaperRow, ...] = ()
    for name in names:
        counts = [int(text) for text in paper.columns_of(SPHERE_SCENES[name])]
        columns += [column(name, count) for count in counts if effort.fits(count)]
        told += paper.rows_of(SPHERE_SCENES[name], f"{name} {{}}".format)
    note = "The paper's GTX 680 ran out of memory with GS at 3686400. Triangles are as near as whole rings allow."
    sweep = _sweep(
        "milet-spheres", "Spheres of more and more triangles", "3 and 4", "scene and triangles",
        [one.name for one in columns], told, effort.size, note,
    )  # fmt: skip
    return run_sweep(sweep, columns, CHECKED, clock)


OBJECT_SCENES = {"100k": (100_000, paper.HUNDRED_THOUSAND), "1M": (1_000_000, paper.MILLION)}


def run_objects(names: Sequence[str], effort: Effort, clock: Clock) -> SweepRecord:
    """Tables 5 and 9: the same number of triangles in more and more objects, a draw call for each."""
    options: dict[str, Any] = {"counting": "zfail", "counter": "stencil", "culling": False}
    older = {**options, "determinism": "three-edge"}

    def column(name: str, triangles: int, objects: int) -> Column:
        grid = grid_of(objects)
        rows: dict[str, Method] = {
            TS: TsByObject(**options),
            TS_3: TsByObject(**older),
            GS: GsByObject(**options),
            GS_3: GsByObject(**older),
            "TS, one call": make_method("silhouette-ts", **options),
            "GS, one call": make_method("silhouette-gs", **options),
        }
        return Column(f"{name} {objects}", partial(models.spheres, grid, triangles), _around(grid, effort), rows)

    columns: list[Column] = []
    told: tuple[PaperRow, ...] = ()
    for name in names:
        triangles, text = OBJECT_SCENES[name]
        if effort.fits(triangles):
            columns += [column(name, triangles, int(count)) for count in paper.columns_of(text)]
        told += paper.rows_of(text, f"{name} {{}}".format)
    note = "Sides are drawn object by object, each by a call from Python, light caps by one call for all of them."
    sweep = _sweep(
        "milet-objects", "More and more objects", "5 and 9", "triangles, objects",
        [one.name for one in columns], told, effort.size, note,
    )  # fmt: skip
    return run_sweep(sweep, columns, CHECKED, clock)


def run_shadow_map(effort: Effort, clock: Clock) -> SweepRecord:
    """Table 6: beside shadow mapping at 8192 x 8192, and the alias-free maps whose speed the paper infers from it."""
    names = [name for name in paper.columns_of(paper.SHADOW_MAP) if effort.fits(int(name))]
    rows = {
        SM: make_method("shadow-map"),
        TS: as_paper("silhouette-ts"),
        "alias-free-map": make_method("alias-free-map"),
        "frustum": make_method("frustum"),
        **_on_gpus_only(effort),
    }
    told = paper.rows_of(paper.SHADOW_MAP, order=paper.SHADOW_MAP_ORDER)
    # Sintorn, Eisemann and Assarsson 2008, as the paper tells it.
    inferred = tuple(
        PaperRow(row, "inferred", dict.fromkeys(names, value)) for row, value in ((SM, 1.0), ("alias-free-map", 3.0))
    )
    note = "SM has 8192 x 8192 texels. That alias-free maps take three times as long is what the paper infers."
    sweep = _sweep(
        "milet-shadow-map", "Beside shadow maps", "6", "triangles", names, told + inferred, effort.size, note, base=SM
    )
    columns = [
        Column(name, partial(models.spheres, (10, 10), int(name)), _around((10, 10), effort), rows) for name in names
    ]
    return run_sweep(sweep, columns, CHECKED, clock)


INVISIBLE_TRIANGLES = 1_000_000


def run_invisible(effort: Effort, clock: Clock) -> SweepRecord:
    """Table 7: how many times less a view of nothing takes than one of everything."""
    triangles = INVISIBLE_TRIANGLES if effort.fits(INVISIBLE_TRIANGLES) else min(effort.most or 100_000, 100_000)
    rows = {**silhouettes(), "TS, culling": make_method("silhouette-ts", counting="zfail", counter="stencil")}
    grids: dict[str, Grid] = {"1x1": (1, 1), "50x50": (50, 50)}

    def column(name: str, away: bool) -> Column:
        grid = grids[name]
        return Column(
            f"{name} away" if away else name,
            partial(models.spheres, grid, triangles),
            lambda scene: facing_views(scene, grid, effort.count(SPHERES_SECONDS), effort.size, away),
            rows,
        )

    note = (
        f"{triangles:,} triangles; the paper does not tell how many. A number says how many times less a view with "
        "the back to the scene takes than one of all of it, by the whole time and by OpenGL's part."
    )
    sweep = _sweep(
        "milet-invisible", "Shadow volumes out of view", "7", "spheres", list(grids),
        paper.rows_of(paper.INVISIBLE, quantities=paper.SPEED_UPS), effort.size, note, quantities=paper.SPEED_UPS,
    )  # fmt: skip
    columns = [column(name, away) for name in grids for away in (False, True)]
    measured = run_sweep(sweep, columns, CHECKED, clock)
    cells = [_speed_up(measured, row, name) for name in grids for row in rows]
    return SweepRecord.of(sweep, cells)


def _speed_up(measured: SweepRecord, row: str, name: str) -> Cell:
    both = [one for one in measured.cells if one.row == row and one.column in (name, f"{name} away")]
    missing = next((one.not_run for one in both if one.not_run), None)
    seen, away = both
    if missing is not None:
        return Cell(row, name, seen.guarantee, not_run=missing)
    counters = {}
    for made, quantity in zip(paper.SPEED_UPS, (TIME, OPENGL), strict=True):
        over, under = seen.value(quantity), away.value(quantity)
        if over is not None and under:
            counters[made.counters[0]] = round(1e6 * over / under)
    wrong = seen.wrong + away.wrong
    return Cell(row, name, seen.guarantee, seen.seconds, counters, seen.checked + away.checked, wrong)


OVERALL_TRIANGLES = 4_000_000


def run_overall(folder: Path | None, effort: Effort, clock: Clock) -> SweepRecord:
    """Table 8: all methods, on spheres of four million triangles (fewer in short) and on Sponza."""
    triangles = OVERALL_TRIANGLES if effort.fits(OVERALL_TRIANGLES) else min(effort.most or 100_000, 100_000)
    rows = {
        TS: as_paper("silhouette-ts"),
        GS: as_paper("silhouette-gs"),
        TS_TRIANGLE: as_paper("triangle-ts"),
        GS_TRIANGLE: as_paper("triangle-gs"),
        SM: make_method("shadow-map"),
        "silhouette-ts": make_method("silhouette-ts"),
        "silhouette-compute": make_method("silhouette-compute"),
        "alias-free-map": make_method("alias-free-map"),
        "frustum": make_method("frustum"),
        **_on_gpus_only(effort),
    }
    spheres = f"spheres {triangles}"
    columns = [
        Column(spheres, partial(models.spheres, (10, 10), triangles), _around((10, 10), effort), rows),
        Column("sponza", _sponza(folder), _along_sponza(effort, effort.size), rows),
    ]
    told = paper.rows_of(
        paper.OVERALL, lambda name: name if name == "sponza" else f"spheres {name}", paper.OVERALL_ORDER
    )
    note = (
        "The paper has no shadow map of Sponza, whose light is amid the scene: it had no cube maps. Rows by a method's "
        "name have its default options."
    )
    sweep = _sweep("milet-overall", "All methods", "8", "scene", [one.name for one in columns], told, effort.size, note)
    return run_sweep(sweep, columns, CHECKED, clock)


def _on_gpus_only(effort: Effort) -> dict[str, Method]:
    """What takes seconds a frame on a software driver."""
    return {"frustum-gl": make_method("frustum-gl")} if effort.full else {}


def _sweep(
    benchmark: str,
    title: str,
    table: str,
    axis: str,
    columns: Sequence[str],
    told: tuple[PaperRow, ...],
    size: tuple[int, int] | None = None,
    note: str = "",
    base: str = TS,
    quantities: tuple[Quantity, ...] = (TIME, OPENGL),
) -> Sweep:
    source = f"{SOURCE} {table}"
    return Sweep(benchmark, title, source, axis, tuple(columns), base, told, size, AS_THEIRS + note, quantities)


def _around(grid: Grid, effort: Effort) -> Callable[[Scene], Sequence[View]]:
    return lambda _: spheres_views(grid, effort.count(SPHERES_SECONDS), effort.size)


def _sponza(folder: Path | None) -> Callable[[], Scene]:
    @cache
    def load() -> Scene:
        return SCENES["sponza"].load(folder)

    return load


def _along_sponza(effort: Effort, size: tuple[int, int]) -> Callable[[Scene], Sequence[View]]:
    return lambda scene: sponza_views(scene, effort.count(SPONZA_SECONDS), size)
