"""Many sensors under many suns: exact shadows beside a plain loop over Embree."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.bench.measure import stopwatch
from umbrae.bench.runner import Runner
from umbrae.bench.sun_record import SunRun
from umbrae.clock import Clock
from umbrae.light import Light
from umbrae.mask import Guarantee
from umbrae.memory import require
from umbrae.methods.oracle import Oracle
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.sun import surface_sensors
from umbrae.sun.sensors import facets

_BYTES_PER_SENSOR = 320
"""Making the grid, which takes the most, measured."""
_FINER = 0.9
"""The grid is a little finer than the number of sensors asks for: where faces cut it, points fall out."""


def pick_sensors(scene: Scene, count: int) -> ViewSamples:
    """Sensors `(count,)`, perhaps fewer on tiny scenes: a regular pick from a grid over the faces, along a curve.

    Raises
    ------
    CapacityError
        When they would not fit into memory.
    """
    require(count * _BYTES_PER_SENSOR, f"a pick of {count:,} sensors")
    area = float(facets(scene)[1].sum())
    grid = surface_sensors(scene, _FINER * math.sqrt(area / count))
    picked = grid.take(np.arange(min(count, grid.size)) * grid.size // min(count, grid.size))
    # Neighbours together, as `sun_study` has them: good for the caches of all contestants.
    return picked.take(picked.along_curve)


def run_sun(
    scene: Scene,
    sensors: ViewSamples,
    suns: Sequence[Light],
    runners: Sequence[Runner[Any]],
    checked: int,
    clock: Clock,
) -> tuple[SunRun, ...]:
    """Time all runners on sensors `(n,)` on faces, sun by sun in turn.

    Methods of Umbrae decide every sensor; what promises nothing is asked only about those that face the sun. Call it
    once on next to nothing before, so that nothing is compiled while the time is taken.

    Parameters
    ----------
    runners
        The first promises to be exact: the verdicts of all are compared with its own.
    checked
        How many verdicts of each method of Umbrae are compared with the oracle, at least, the same number of each sun.
    clock
        Hears how many suns are done; it does not listen while the time is taken.
    """
    tracks = [_Track(runner, runner.unavailable()) for runner in runners]
    running = [track for track in tracks if track.not_run is None]
    with clock.span("prepare"):
        for track in running:
            track.prepare(scene)
        oracle = Oracle().prepare(scene)
    normal = facets(scene)[0][sensors.triangle] * sensors.side[:, None]
    every = np.arange(sensors.size)
    chance, drawn_each = np.random.default_rng(0), min(-(-checked // len(suns)), sensors.size)
    with clock.span("suns"):
        for done, light in enumerate(suns, 1):
            facing = np.flatnonzero(normal @ light.position[:3].astype(np.float64) > 0.0)
            # Nobody always comes after the same one, and finds the caches as that one leaves them.
            first = done % len(running) if running else 0
            answers = {}
            for track in (*running[first:], *running[:first]):
                answers[track.runner] = track.shadow(light, sensors if track.is_exact else sensors.take(facing))
            drawn = np.sort(chance.choice(sensors.size, drawn_each, replace=False))
            truth = oracle.shadow(light, sensors.take(drawn)).in_shadow
            for track in running:
                asked = every if track.is_exact else facing
                track.asked += len(asked)
                track.differ += int((answers[track.runner] != answers[running[0].runner][asked]).sum())
                if track.is_exact:
                    track.checked += len(drawn)
                    track.wrong += int((answers[track.runner][drawn] != truth).sum())
            clock.advance(done, len(suns))
    return tuple(track.result() for track in tracks)


@dataclass
class _Track:
    """A runner on its way through the suns; `not_run` says why it takes no part."""

    runner: Runner[Any]
    not_run: str | None
    clock: Clock = field(default_factory=Clock)
    prepare_seconds: float = 0.0
    trace_seconds: list[float] = field(default_factory=list)
    asked: int = 0
    differ: int = 0
    checked: int = 0
    wrong: int = 0

    @property
    def is_exact(self) -> bool:
        """Whether the runner promises that all its verdicts are right."""
        return self.runner.guarantee is Guarantee.EXACT

    def prepare(self, scene: Scene) -> None:
        """Geometry, and the work that depends on it alone, timed."""
        self.runner.set_geometry(scene)
        self.prepare_seconds, _ = stopwatch(lambda: self.runner.prepare(self.clock))

    def shadow(self, light: Light, samples: ViewSamples) -> NDArray[np.bool_]:
        """One more sun, timed."""
        runner = self.runner
        runner.set_samples(samples)
        seconds, answer = stopwatch(lambda: runner.shadow(light, self.clock))
        self.trace_seconds.append(round(seconds, 7))
        return runner.mask(answer).in_shadow

    def result(self) -> SunRun:
        """What there is to report: no times for a broken guarantee."""
        runner = self.runner
        about = SunRun(runner.name, str(runner.guarantee), runner.options(), self.not_run)
        if self.not_run is not None:
            return about
        found = replace(about, asked=self.asked, differ=self.differ, checked=self.checked, wrong=self.wrong)
        if found.broken:
            return found
        return replace(
            found,
            prepare_seconds=self.prepare_seconds,
            trace_seconds=tuple(self.trace_seconds),
            stages=self.clock.seconds(),
        )
