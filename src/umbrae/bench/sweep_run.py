"""Measuring a paper's table: all rows of a column take turns on every frame of its flight."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from umbrae.bench.case import View
from umbrae.bench.measure import stopwatch
from umbrae.bench.sweep import Cell, Sweep, SweepRecord
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import UmbraeError
from umbrae.mask import ShadowMask
from umbrae.methods import Caster, Method
from umbrae.samples import ViewSamples
from umbrae.sampling import sample
from umbrae.scene import Scene
from umbrae.shade import shade
from umbrae.verify import Truth

WARM_UPS = 2


@dataclass(frozen=True)
class Column:
    """One column: its name, how to come by its scene, and what is seen of it, one view a frame.

    `rows` are the methods of this column by name; a row that has none is left out. `looks` are functions that give the
    scene other materials, for the rows that want them. `seen` finds the samples. The time is that of the shadows, or of
    a whole `picture`: its samples, shadows and shading.
    """

    name: str
    scene: Callable[[], Scene]
    views: Callable[[Scene], Sequence[View]]
    rows: Mapping[str, Method]
    looks: Mapping[str, Callable[[Scene], Scene]] = field(default_factory=dict)
    picture: bool = False
    seen: Callable[[Scene, Camera], ViewSamples] = sample


def run_sweep(sweep: Sweep, columns: Sequence[Column], check: int, clock: Clock) -> SweepRecord:
    """Measure all columns; `check` covered samples of each column's last frame go to the oracle for each row.

    What is timed is `Caster.shadow`: the shadows of samples that are there already, with a caster made before. What
    OpenGL had of it, until its stages had finished, is counted as `opengl_ns`. A column whose scene cannot be had, and
    a row that cannot run, say so in their cells.
    """
    cells: list[Cell] = []
    for column in columns:
        with clock.span(f"{sweep.axis} {column.name}"):
            try:
                scene = column.scene()
            except UmbraeError as error:
                cells += [Cell(row, column.name, not_run=str(error)) for row in column.rows]
                continue
            cells += _measure(column, scene, check, clock)
    return SweepRecord.of(sweep, cells)


class _Row:
    """A method on its way through a column; `stopped` says why it takes no further part."""

    def __init__(self, name: str, method: Method, scene: Scene) -> None:
        self.name, self.method = name, method
        self.seconds: list[float] = []
        self.counters: list[Mapping[str, int]] = []
        self.mask: ShadowMask | None = None
        self.stopped: str | None = None
        self._caster: Caster | None = None
        self.scene = scene

    def frame(self, view: View, samples: ViewSamples, timed: bool, sampled: float | None) -> None:
        """The shadows of a frame; what Umbrae refuses to do ends this row's way, not the benchmark.

        With the seconds that its samples took, the time is that of the picture.
        """
        if self.stopped is not None:
            return
        clock = Clock()
        try:
            caster = self._caster = self._caster or self.method.prepare(self.scene)
            taken, mask = stopwatch(lambda: caster.shadow(view.light, samples, clock))
            if sampled is not None:
                taken += sampled + stopwatch(lambda: shade(self.scene, view.camera, [view.light], samples, [mask]))[0]
        except UmbraeError as error:
            self.stopped = str(error)
            return
        self.mask = mask
        if timed:
            self.seconds.append(round(taken, 7))
            self.counters.append({**mask.stats, **_opengl(clock)})

    def cell(self, column: str, truth: Truth) -> Cell:
        """What there is to report of a column; the last mask against the truth."""
        if self.stopped is not None or self.mask is None:
            return Cell(self.name, column, str(self.method.guarantee), not_run=self.stopped)
        # Options can take back what a method promises.
        guarantee = str(self.mask.guarantee)
        verdict = truth.judge(self.mask)
        counters = {name: int(np.median([one.get(name, 0) for one in self.counters])) for name in self.counters[-1]}
        return Cell(self.name, column, guarantee, tuple(self.seconds), counters, verdict.checked, verdict.outside_band)


def _opengl(clock: Clock) -> dict[str, int]:
    """Nanoseconds of the stages that OpenGL has finished; nothing of a method that has none.

    Those of its queries are not asked: software drivers answer before the work is done.
    """
    seconds = clock.seconds()
    stages = [name.removeprefix("gpu ") for name in seconds if name.startswith("gpu ")]
    return {"opengl_ns": round(1e9 * sum(seconds[name] for name in stages))} if stages else {}


def _measure(column: Column, scene: Scene, check: int, clock: Clock) -> list[Cell]:
    views = column.views(scene)
    looks = {name: column.looks[name](scene) if name in column.looks else scene for name in column.rows}
    rows = [_Row(name, method, looks[name]) for name, method in column.rows.items()]
    frames = [*[views[0]] * WARM_UPS, *views]
    for number, view in enumerate(frames):
        timed = {one: stopwatch(partial(column.seen, one, view.camera)) for one in dict.fromkeys(looks.values())}
        samples = {one: seen for one, (_, seen) in timed.items()}
        # Nobody always comes after the same one, and finds the caches as that one leaves them.
        first = number % max(1, len(rows))
        for row in (*rows[first:], *rows[:first]):
            sampled = timed[row.scene][0] if column.picture else None
            row.frame(view, samples[row.scene], number >= WARM_UPS, sampled)
        clock.advance(number + 1, len(frames))
    truths = {one: Truth.find(one, views[-1].light, seen, check) for one, seen in samples.items()}
    return [row.cell(column.name, truths[row.scene]) for row in rows]
