"""Timing: all runners of a case in turn, on the same view, so that what disturbs one disturbs all."""

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from umbrae.bench.case import WARM_UPS, Case, View
from umbrae.bench.peak import peak_bytes
from umbrae.bench.record import CaseResult, RunnerResult, Times
from umbrae.bench.runner import Runner
from umbrae.clock import Clock
from umbrae.errors import UmbraeError
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.memory import drop_spare
from umbrae.samples import ViewSamples
from umbrae.sampling import sample
from umbrae.scene import Scene
from umbrae.verify import verify

Result = TypeVar("Result")


def measure(
    case: Case, scene: Scene, views: Sequence[View], runners: Sequence[Runner[Any]], count: int, clock: Clock
) -> CaseResult:
    """Run a case: warm-ups with the first views, a timed run with each other one, a check of the last masks.

    Parameters
    ----------
    count
        How many random covered samples of the last cold and of the last warm mask to compare with the oracle.
    clock
        Hears how many of the runs are done; it does not listen while the time is taken.
    """
    tracks = [_Track(runner, runner.unavailable()) for runner in runners]
    samples = sample(scene, views[0].camera)
    for number, view in enumerate(views):
        if number:
            samples = sample(scene, view.camera)
        # Nobody always comes after the same one, and finds the caches as that one leaves them.
        first = number % max(1, len(tracks))
        for track in (*tracks[first:], *tracks[:first]):
            track.attempt(_Track.run, scene, samples, view.light, number >= WARM_UPS)
        clock.advance(number, len(views))
    for track in tracks:
        track.attempt(_Track.check, scene, samples, views[-1].light, count)
        track.attempt(_Track.weigh, scene, samples, views[-1].light)
    clock.advance(len(views), len(views))
    results = tuple(track.result() for track in tracks)
    return CaseResult(case, len(scene.triangles), samples.size, int(samples.covered.sum()), None, results)


@dataclass
class _Track:
    """A runner on its way through a case; `stopped` says why it takes no further part."""

    runner: Runner[Any]
    stopped: str | None
    prepared: bool = False
    build: list[float] = field(default_factory=list)
    trace: list[float] = field(default_factory=list)
    warm: list[float] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)
    masks: list[ShadowMask] = field(default_factory=list)
    checked: int = 0
    wrong: int = 0
    broken: bool = False
    peak: int | None = None

    def attempt(self, step: Callable[..., None], *arguments: Any) -> None:
        """Take a step; an error that Umbrae raises on purpose ends this runner's way, not the benchmark."""
        if self.stopped is None:
            try:
                step(self, *arguments)
            except UmbraeError as error:
                self.stopped = str(error)

    def run(self, scene: Scene, samples: ViewSamples, light: Light, timed: bool) -> None:
        """Warm with the geometry of the run before, then cold with new arrays."""
        clock, runner = Clock(), self.runner
        masks = []
        warm = 0.0
        if self.prepared:
            runner.set_samples(samples)
            warm, answer = stopwatch(lambda: runner.shadow(light, Clock()))
            masks.append(runner.mask(answer))
        runner.set_geometry(_copy(scene))
        runner.set_samples(samples)
        build, _ = stopwatch(lambda: runner.prepare(clock))
        trace, answer = stopwatch(lambda: runner.shadow(light, clock))
        masks.append(runner.mask(answer))
        self.prepared = True
        if timed:
            self.build.append(build)
            self.trace.append(trace)
            self.warm.append(warm)
            self.stages.append(clock.seconds())
            self.masks = masks

    def check(self, scene: Scene, samples: ViewSamples, light: Light, count: int) -> None:
        """Compare the last two masks with the oracle, each in samples of its own choice."""
        for seed, mask in enumerate(self.masks):
            verdict = verify(scene, light, samples, mask, count=-(-count // len(self.masks)), seed=seed)
            self.checked += verdict.checked
            self.wrong += verdict.outside_band
        self.broken = self.wrong > 0 and self.runner.guarantee is not Guarantee.NONE

    def weigh(self, scene: Scene, samples: ViewSamples, light: Light) -> None:
        """One more cold run, for its memory."""
        runner = self.runner
        runner.set_geometry(_copy(scene))
        runner.set_samples(samples)

        def cold() -> Any:
            runner.prepare(Clock())
            return runner.shadow(light, Clock())

        drop_spare()  # what is kept between calls counts as well
        self.peak = peak_bytes(cold)

    def result(self) -> RunnerResult:
        """What there is to report: no times for a broken guarantee."""
        runner = self.runner
        about = RunnerResult(runner.name, str(runner.guarantee), runner.options(), self.stopped)
        if self.stopped is not None:
            return about
        seconds: dict[str, Times] = {}
        stages: dict[str, float] = {}
        if not self.broken:
            cold = [build + trace for build, trace in zip(self.build, self.trace, strict=True)]
            runs = {"build": self.build, "trace": self.trace, "cold": cold, "warm": self.warm}
            seconds = {name: Times.of(values) for name, values in runs.items()}
            names = dict.fromkeys(name for stage in self.stages for name in stage)
            stages = {name: float(np.median([stage.get(name, 0.0) for stage in self.stages])) for name in names}
        return RunnerResult(
            about.name, about.guarantee, about.options, None, self.checked, self.wrong, self.broken, seconds, stages,
            dict(self.masks[-1].stats), self.peak,
        )  # fmt: skip


def _copy(scene: Scene) -> Scene:
    """New arrays with the same geometry: a constructor copies them, and checks them, outside the time."""
    return Scene(scene.positions, scene.triangles, scene.materials, scene.material_id)


def stopwatch(work: Callable[[], Result]) -> tuple[float, Result]:
    """Seconds and result; garbage is not collected meanwhile, as in `timeit`."""
    collects = gc.isenabled()
    gc.disable()
    try:
        start = time.perf_counter()
        result = work()
        return time.perf_counter() - start, result
    finally:
        if collects:
            gc.enable()
