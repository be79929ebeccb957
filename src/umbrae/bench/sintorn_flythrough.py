"""Times and test-and-set operations along a flight: Figure 7 of Sintorn, Olsson and Assarsson 2011."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from umbrae.bench.case import View
from umbrae.bench.flythrough import FlyThrough, Place
from umbrae.bench.scenes import SCENES, extent
from umbrae.bench.sweep import TIME, PaperRow, Quantity, Sweep, SweepRecord
from umbrae.bench.sweep_run import Column, run_sweep
from umbrae.clock import Clock
from umbrae.methods import Method, make_method
from umbrae.scene import Scene

SIZES = (1024, 4096)
"""Pixels a side, as in the paper."""
CHECKED = 2_000
"""Samples of the last frame that each row's mask is held against the oracle in."""

FLIGHTS: dict[str, Sequence[tuple[Place, Place]]] = {
    "sponza": (
        ((-1050, 120, 0), (0, 250, 40)),
        ((-500, 160, 180), (600, 300, -60)),
        ((150, 300, 120), (900, 150, -250)),
        ((700, 560, -60), (-300, 150, 60)),
        ((200, 650, -250), (-900, 60, 200)),
    ),
    "city": (
        ((-800, 420, 850), (0, 0, 150)),
        ((-350, 220, 450), (150, 20, -100)),
        ((-100, 120, 200), (300, 20, 0)),
        ((350, 180, -150), (0, 10, 250)),
        ((700, 420, -500), (-200, 0, 100)),
    ),
    "spheres-96k": (
        ((-14, 8, 14), (0, 0, 0)),
        ((-5, 5, 8), (3, 0, -2)),
        ((3, 4.5, 3), (0, 0, -8)),
        ((8, 6, -4), (-2, 0, -2)),
        ((3, 9, -14), (0, 0, 2)),
    ),
}
"""Where the camera is and what it looks at, from key to key.

Two stand in for the Epic Citadel; spheres consist of closed solids alone, as the paper's front-face culling expects.
"""

OPERATIONS = Quantity("operations", "million", 1e6, ("tile_frustum_tests", "sample_frustum_tests", "counter_updates"))
"""Test-and-set operations: tile and sample tests of frusta, updates of a volume's counter."""

_UNCULLED = {1024: 2.2, 4096: 2.4}
"""How many times the operations the paper needs without front-face culling (section 4)."""

NOTE = (
    "Time is that of the shadows, their samples given. The paper's curves were not to be had as numbers; the "
    "citadel's line holds what its text tells: operations with front-face culling over those without. It also tells "
    "that sixteen times the samples take about 16 times the operations in z-pass, two to four times in its own "
    "method; that in time its method with culling beats z-fail at both sizes and is level with z-pass at 4096. "
    "'culled' leaves out those triangles of closed solids that face away from the light; the paper, those that face "
    "it. A tile test of frustum is of 16 frusta at once, one of frustum-gl of a single one. Nothing "
    "else is culled. Volumes are silhouette-gs; their counter is of floats, so a side that counts twice is one "
    "update, and two with the paper's stencil."
)


def sweep_of(scenes: Sequence[str], sizes: Sequence[int]) -> Sweep:
    """What the table is about."""
    columns = {f"{scene} {size}": _UNCULLED.get(size) for scene in scenes for size in sizes}
    told = {name: times for name, times in columns.items() if times is not None}
    device = "citadel, GTX480"
    paper = (
        PaperRow("frustum", device, told, OPERATIONS.name),
        PaperRow("frustum, culled", device, dict.fromkeys(told, 1.0), OPERATIONS.name),
    )
    return Sweep(
        "sintorn-flythrough",
        "Fly-through",
        "Sintorn, Olsson, Assarsson 2011, Figure 7",
        "scene and pixels a side",
        tuple(columns),
        "frustum",
        paper,
        note=NOTE,
        quantities=(TIME, OPERATIONS),
    )


def rows_of(opengl: bool) -> dict[str, Method]:
    """The contestants by name, those on OpenGL if wanted."""
    rows = {
        "frustum": make_method("frustum", culling=False),
        "frustum, culled": make_method("frustum", culling=False, front_face_culling=True),
    }
    if opengl:
        rows |= {
            "frustum-gl": make_method("frustum-gl", culling=False),
            "frustum-gl, culled": make_method("frustum-gl", culling=False, front_face_culling=True),
            "z-pass": make_method("silhouette-gs", counting="zpass", culling=False),
            "z-fail": make_method("silhouette-gs", counting="zfail", culling=False),
        }
    return rows


def flight(name: str, scene: Scene, frames: int, size: int) -> list[View]:
    """The views along a flight, the light at rest."""
    light, near = SCENES[name].light(scene, False), 1e-4 * extent(scene)
    path = FlyThrough.between(name, len(FLIGHTS[name]) - 1, FLIGHTS[name])
    return [View(camera, light) for camera in path.cameras(frames, size, size, near)]


def run_flythrough(
    folder: Path | None,
    scenes: Sequence[str],
    sizes: Sequence[int],
    opengl_sizes: Sequence[int],
    frames: int,
    clock: Clock,
) -> SweepRecord:
    """All scenes at all sizes; methods on OpenGL take part at `opengl_sizes`."""

    @cache
    def load(name: str) -> Scene:
        return SCENES[name].load(folder)

    def column(name: str, size: int) -> Column:
        return Column(
            f"{name} {size}",
            lambda: load(name),
            lambda scene: flight(name, scene, frames, size),
            rows_of(size in opengl_sizes),
        )

    columns = [column(name, size) for name in scenes for size in sizes]
    return run_sweep(sweep_of(scenes, sizes), columns, CHECKED, clock)
