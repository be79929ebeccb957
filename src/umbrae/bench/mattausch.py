"""Table 1 of Mattausch et al. 2012: discrete, accurate and smooth silhouettes, made anew for each frame or kept."""

import dataclasses
import datetime
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from rich.console import Console
from rich.table import Table

from umbrae.bench import machine
from umbrae.bench.measure import stopwatch
from umbrae.bench.record import SCHEMA
from umbrae.bench.scenes import BenchScene
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import GraphicsError, ModelError
from umbrae.files import save_text
from umbrae.geometry.edges import weld
from umbrae.light import Light
from umbrae.methods.smooth.cpu import Smooth
from umbrae.methods.smooth.gl import SmoothGl
from umbrae.samples import ViewSamples
from umbrae.sampling import sample
from umbrae.scene import Scene

MODELS: dict[str, tuple[str, int]] = {
    "dragon": ("stanford/dragon-100k.obj", 0),
    "spot": ("characters/spot/spot_triangulated.obj", 1),
    "spot low": ("characters/spot/spot_triangulated.obj", 0),
    "figure": ("characters/RiggedFigure.glb", 1),
}
"""Models for the paper's dragon, Paolo, Paolo low and ghost (the last three are not public), and how often to halve."""

PAPER: dict[str, tuple[str, tuple[float, float, float], tuple[float, float, float]]] = {
    "dragon": ("Dragon, 100k", (11.1, 10.0, 13.1), (8.3, 8.4, 8.8)),
    "spot": ("Paolo, 30k", (5.0, 5.5, 5.4), (4.9, 4.9, 4.9)),
    "spot low": ("Paolo l., 6k", (4.8, 4.4, 4.6), (4.5, 4.3, 4.4)),
    "figure": ("Ghost, 1k", (4.3, 4.1, 4.1), (4.1, 4.1, 4.1)),
}
"""The paper's scene, and its milliseconds by silhouette: made anew, kept."""

SIZE = (1024, 768)
EXTENT, EPSILON = 10.0, 0.01
"""Models are scaled to this size, which the paper does not tell; its maximal error."""
CREASE = 60.0
"""Of normals for models that come without, in degrees."""
KINDS = ("discrete", "accurate", "smooth")
WARM_UPS = 2


@dataclass(frozen=True)
class SmoothRun:
    """One method and silhouette on one model.

    `rebuilt_seconds`, `kept_seconds` of each frame, with a moved light and with the same; `differ` samples from the
    triangles' own shadow.
    """

    model: str
    triangles: int
    method: str
    silhouette: str
    contour_edges: int = 0
    rebuilt_seconds: tuple[float, ...] = ()
    kept_seconds: tuple[float, ...] = ()
    differ: int = 0
    not_run: str | None = None


@dataclass(frozen=True)
class SmoothRecord:
    """A whole table, on what machine; `SmoothRecord.of` stamps it."""

    machine: Mapping[str, Any]
    date: str
    size: tuple[int, int]
    epsilon: float
    runs: tuple[SmoothRun, ...]

    @classmethod
    def of(cls, runs: Sequence[SmoothRun]) -> "SmoothRecord":
        """On this machine, now."""
        date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        return cls(machine.describe(), date, SIZE, EPSILON, tuple(runs))

    def save(self, path: Path) -> None:
        """Write the file, whole or not at all."""
        save_text(path, json.dumps(self.as_dict(), indent=1) + "\n")

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"schema": SCHEMA, "benchmark": "mattausch", **dataclasses.asdict(self)}

    def show(self, console: Console) -> None:
        """Print the table: milliseconds, and ratios to the discrete silhouette made anew beside the paper's."""
        rows = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
        for name in ("model", "method", "silhouette"):
            rows.add_column(name, no_wrap=True)
        for name in ("anew", "kept ms", "ratios", "paper's", "chords", "differ"):
            rows.add_column(name, justify="right", no_wrap=True)
        base = 1.0
        for run in self.runs:
            if run.not_run is not None:
                continue
            anew, kept = float(np.median(run.rebuilt_seconds)), float(np.median(run.kept_seconds))
            base = anew if run.silhouette == "discrete" else base
            _, theirs_anew, theirs_kept = PAPER[run.model]
            place = KINDS.index(run.silhouette)
            rows.add_row(
                run.model,
                run.method,
                run.silhouette,
                f"{1e3 * anew:.1f}",
                f"{1e3 * kept:.1f}",
                f"{anew / base:.2f} {kept / base:.2f}",
                f"{theirs_anew[place] / theirs_anew[0]:.2f} {theirs_kept[place] / theirs_anew[0]:.2f}",
                f"{run.contour_edges:,}",
                f"{run.differ:,}",
            )
        console.print(rows)
        for reason in dict.fromkeys(f"{run.model}, {run.method}: {run.not_run}" for run in self.runs if run.not_run):
            console.print(f"  not run: {reason}", markup=False)
        sizes = ", ".join(
            f"{name} {count:,}" for name, count in {run.model: run.triangles for run in self.runs}.items()
        )
        console.print(
            f"\nTriangles: {sizes}. Frames with a light that moves (anew), and with one at rest (kept); ratios to the "
            "discrete silhouette made anew, the paper's of its own dragon, Paolo, Paolo low and ghost. Differ: samples "
            "from the triangles' own shadow.",
            markup=False,
        )


def scene_of(model: str, folder: Path | None) -> Scene:
    """A model in its size over a ground, with smooth normals."""
    path, halvings = MODELS[model]
    loaded = BenchScene(path).load(folder)
    positions, triangles = loaded.positions.astype(np.float64), loaded.triangles.astype(np.int64)
    for _ in range(halvings):
        ids = weld(positions.astype(np.float32))
        first = np.zeros(int(ids.max()) + 1, np.int64)
        first[ids] = np.arange(len(ids))
        positions, triangles = trimesh.remesh.subdivide(positions[first], ids[triangles])[:2]
    low, high = positions.min(axis=0), positions.max(axis=0)
    positions = (positions - [*(low + high)[:1] / 2, low[1], (low[2] + high[2]) / 2]) * (EXTENT / (high - low).max())
    shape = Scene(positions.astype(np.float32), triangles)
    if halvings or loaded.normals is None:
        shape = shape.smoothed(CREASE)
    else:
        shape = Scene(shape.positions, triangles, normals=loaded.normals)
    assert shape.normals is not None
    ground = EXTENT * np.array([(-3, -0.02, -3), (3, -0.02, -3), (3, -0.02, 3), (-3, -0.02, 3)])
    return Scene(
        np.concatenate([ground, shape.positions]).astype(np.float32),
        np.concatenate([[(0, 2, 1), (0, 3, 2)], shape.triangles + 4]),
        normals=np.concatenate([np.tile((0.0, 1.0, 0.0), (4, 1)), shape.normals]),
    )


def run_mattausch(folder: Path | None, frames: int, clock: Clock) -> SmoothRecord:
    """All models, both methods, all silhouettes: `frames` with a light that moves, and as many with it at rest."""
    runs: list[SmoothRun] = []
    for model in MODELS:
        with clock.span(f"{model}"):
            try:
                scene = scene_of(model, folder)
            except ModelError as error:
                runs += [SmoothRun(model, 0, "all", kind, not_run=str(error)) for kind in KINDS]
                continue
            camera = Camera.look_at((2, 12, 21), (-3, 3, -2), fov_y=40, width=SIZE[0], height=SIZE[1])
            samples = sample(scene, camera)
            for kind in KINDS:
                runs.append(_run(model, scene, samples, Smooth(silhouette=kind, epsilon=EPSILON), frames, clock))
            # The paper has but its counter.
            for kind in KINDS:
                counter_alone = SmoothGl(silhouette=kind, epsilon=EPSILON, look_twice=False)
                runs.append(_run(model, scene, samples, counter_alone, frames, clock))
    return SmoothRecord.of(runs)


def _run(
    model: str, scene: Scene, samples: ViewSamples, method: Smooth | SmoothGl, frames: int, clock: Clock
) -> SmoothRun:
    about = SmoothRun(model, len(scene.triangles) - 2, method.name, method.silhouette)
    own = Smooth(silhouette="discrete").prepare(scene)
    try:
        caster = method.prepare(scene)
        rebuilt, kept, differ, chords = [], [], 0, 0
        for frame in range(WARM_UPS + frames):
            light = Light.point((9.0, 13.0 + 0.01 * frame, 7.0))
            anew, mask = stopwatch(lambda light=light: caster.shadow(light, samples))  # type: ignore[misc]
            again, _ = stopwatch(lambda light=light: caster.shadow(light, samples))  # type: ignore[misc]
            if frame >= WARM_UPS:
                rebuilt.append(round(anew, 7))
                kept.append(round(again, 7))
            differ = int((mask.in_shadow != own.shadow(light, samples).in_shadow).sum()) if frame == 0 else differ
            chords = int(mask.stats["contour_edges"])
            clock.advance(frame + 1, WARM_UPS + frames)
    except GraphicsError as error:
        return dataclasses.replace(about, not_run=str(error))
    return dataclasses.replace(
        about, contour_edges=chords, rebuilt_seconds=tuple(rebuilt), kept_seconds=tuple(kept), differ=differ
    )
