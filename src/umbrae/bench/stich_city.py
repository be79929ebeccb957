"""A walk through a town and a flight above it, with and without culling (Stich et al. 2007, section 11.3.3)."""

import dataclasses
import datetime
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from umbrae import models
from umbrae.bench import machine
from umbrae.bench.measure import stopwatch
from umbrae.bench.record import SCHEMA
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import GraphicsError
from umbrae.files import save_text
from umbrae.mask import ShadowMask
from umbrae.methods import Caster, make_method
from umbrae.samples import ViewSamples
from umbrae.sampling import sample
from umbrae.sampling.cpu import Bands
from umbrae.sampling.seen import picture_of
from umbrae.scene import Scene

SIZE = (1024, 768)
WARM_UPS = 2
PICTURE = "picture"
"""In place of a method: the samples themselves, which are what is seen of the scene."""


@dataclass(frozen=True)
class CityRun:
    """One method along one path, or `PICTURE`.

    Attributes
    ----------
    seconds, plain_seconds
        Of each frame's shadows (or samples), with culling and without.
    culled
        `(frames,)` triangles left out.
    queries
        `(frames,)` occlusion queries; boxes in view, for the picture.
    differ
        Samples that differ with and without culling, all frames together; 0, or something is wrong.
    """

    path: str
    method: str
    seconds: tuple[float, ...] = ()
    plain_seconds: tuple[float, ...] = ()
    culled: tuple[int, ...] = ()
    queries: tuple[int, ...] = ()
    differ: int = 0
    not_run: str | None = None


@dataclass(frozen=True)
class CityRecord:
    """A whole benchmark, on what machine; `CityRecord.of` stamps it."""

    machine: Mapping[str, Any]
    date: str
    lots: tuple[int, int]
    triangles: int
    size: tuple[int, int]
    runs: tuple[CityRun, ...]

    @classmethod
    def of(cls, lots: tuple[int, int], triangles: int, runs: Sequence[CityRun]) -> "CityRecord":
        """On this machine, now."""
        date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        return cls(machine.describe(), date, lots, triangles, SIZE, tuple(runs))

    @property
    def broken(self) -> bool:
        """Whether culling changed a mask."""
        return any(run.differ for run in self.runs)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"schema": SCHEMA, "benchmark": "stich-city", **dataclasses.asdict(self)}

    def save(self, path: Path) -> None:
        """Write the file, whole or not at all."""
        save_text(path, json.dumps(self.as_dict(), indent=1) + "\n")

    def show(self, console: Console) -> None:
        """Print medians, worst frames and what was left out, no wider than the console."""
        console.print(f"{self.lots[0]}x{self.lots[1]} lots, {self.triangles:,} triangles", markup=False)
        rows = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
        for name in ("path", "method"):
            rows.add_column(name, no_wrap=True)
        for name in ("culled", "ms", "without", "ratio", "worst", "without", "queries"):
            rows.add_column(name, justify="right", no_wrap=True)
        for run in self.runs:
            if run.not_run is not None:
                continue
            culled, plain = np.array(run.seconds), np.array(run.plain_seconds)
            rows.add_row(
                run.path,
                run.method,
                f"{np.mean(run.culled) / self.triangles:.0%}",
                f"{1e3 * np.median(culled):.1f}",
                f"{1e3 * np.median(plain):.1f}",
                f"{np.median(culled) / np.median(plain):.2f}",
                f"{1e3 * culled.max():.1f}",
                f"{1e3 * plain.max():.1f}",
                f"{np.mean(run.queries):.0f}",
            )
        console.print(rows)
        for run in self.runs:
            if run.not_run is not None:
                console.print(f"  {run.path}, {run.method} not run: {run.not_run}", markup=False)
            if run.differ:
                console.print(
                    f"WRONG: culling changes {run.differ:,} samples of {run.path}, {run.method}", markup=False
                )
        for method in dict.fromkeys(run.method for run in self.runs):
            self._in_view(console, {run.path: run for run in self.runs if run.method == method and run.seconds})

    def _in_view(self, console: Console, by_path: Mapping[str, CityRun]) -> None:
        """Milet et al., Table 7: everything in view beside nothing."""
        if "flight" not in by_path or "away" not in by_path:
            return
        flight, away = by_path["flight"], by_path["away"]
        pairs = (flight.seconds, away.seconds), (flight.plain_seconds, away.plain_seconds)
        ratios = [float(np.median(all_of_it) / np.median(nothing)) for all_of_it, nothing in pairs]
        console.print(
            f"{flight.method}: everything in view takes {ratios[0]:.1f} x the time of nothing in view with "
            f"culling, {ratios[1]:.1f} x without (Milet et al., Table 7: 2 to 5 x)",
            markup=False,
        )


def run_city(
    lots: tuple[int, int], triangles: int, tree: int, methods: Sequence[str], frames: int, clock: Clock
) -> CityRecord:
    """Each method along each path: at eye level, above the roofs, and turned away from everything."""
    with clock.span("make"):
        scene = models.town(lots, triangles, tree)
    paths: dict[str, Callable[[float], Camera]] = {
        "walk": lambda progress: models.town_walk(lots, progress, *SIZE),
        "flight": lambda progress: models.town_flight(lots, progress, *SIZE),
        "away": lambda progress: _away(models.town_flight(lots, progress, *SIZE)),
    }
    runs = []
    for path, view in paths.items():
        with clock.span(f"{path}, {PICTURE}"):
            runs.append(_picture(path, view, scene, frames, clock))
    for method in methods:
        for path, view in paths.items():
            with clock.span(f"{path}, {method}"):
                runs.append(_run(path, method, view, scene, frames, clock))
    return CityRecord.of(lots, len(scene.triangles), runs)


def _away(camera: Camera) -> Camera:
    """The same camera, looking at the sky."""
    up = np.array([0.0, 1.0, 0.0])
    return Camera.look_at(
        camera.eye, camera.eye + up, (0, 0, -1), camera.fov_y, camera.width, camera.height, camera.near
    )


def _run(path: str, method: str, view: Callable[[float], Camera], scene: Scene, frames: int, clock: Clock) -> CityRun:
    light = models.town_sun()
    seconds: dict[bool, list[float]] = {True: [], False: []}
    culled, queries, differ = [], [], 0
    try:
        casters = {culling: make_method(method, culling=culling).prepare(scene) for culling in seconds}
        for frame in range(-WARM_UPS, frames):
            samples = sample(scene, view(max(0, frame) / max(1, frames - 1)))
            masks: dict[bool, ShadowMask] = {}
            # Nobody always comes after the other, and finds the caches as that one leaves them.
            for culling in (True, False) if frame % 2 else (False, True):
                taken, masks[culling] = _timed(casters[culling], light, samples)
                if frame >= 0:
                    seconds[culling].append(round(taken, 7))
            differ += int((masks[True].in_shadow != masks[False].in_shadow).sum())
            if frame >= 0:
                culled.append(int(masks[True].stats.get("culled", 0)))
                queries.append(int(masks[True].stats.get("queries", 0)))
            clock.advance(frame + WARM_UPS + 1, WARM_UPS + frames)
    except GraphicsError as error:
        return CityRun(path, method, not_run=str(error))
    return CityRun(path, method, tuple(seconds[True]), tuple(seconds[False]), tuple(culled), tuple(queries), differ)


def _picture(path: str, view: Callable[[float], Camera], scene: Scene, frames: int, clock: Clock) -> CityRun:
    seconds: dict[bool, list[float]] = {True: [], False: []}
    culled, boxes, differ = [], [], 0
    for frame in range(-WARM_UPS, frames):
        camera = view(max(0, frame) / max(1, frames - 1))
        seen: dict[bool, ViewSamples] = {}
        for culling in (True, False) if frame % 2 else (False, True):
            taken, (bands, seen[culling]) = stopwatch(partial(_look, scene, camera, culling))
            if frame >= 0:
                seconds[culling].append(round(taken, 7))
            if frame >= 0 and culling:
                culled.append(len(scene.triangles) - bands.view.triangles)
                boxes.append(len(bands.view.chosen))
        same = (seen[True].triangle == seen[False].triangle) & (seen[True].depth == seen[False].depth)
        differ += int(same.size - same.sum())
        clock.advance(frame + WARM_UPS + 1, WARM_UPS + frames)
    return CityRun(path, PICTURE, tuple(seconds[True]), tuple(seconds[False]), tuple(culled), tuple(boxes), differ)


def _look(scene: Scene, camera: Camera, culling: bool) -> tuple[Bands, ViewSamples]:
    bands = Bands.of(scene, camera, picture_of(scene, camera, 1), culling)
    return bands, bands.nearest().samples(scene, camera)


def _timed(caster: Caster, *what: Any) -> tuple[float, ShadowMask]:
    return stopwatch(lambda: caster.shadow(*what))
