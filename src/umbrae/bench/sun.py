"""Hours of sun on many sensors, beside a plain loop over Embree."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.bench.runner import Runner
from umbrae.clock import Clock
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.sun import Sky, sun_study
from umbrae.sun.sensors import facets


@dataclass(frozen=True, eq=False)
class SunRun:
    """How long one contestant took.

    Attributes
    ----------
    name
        "umbrae", or the comparator's.
    prepare_seconds, seconds
        Building a tree, and all positions of the sun after that.
    differ
        Verdicts (one per sensor and position of the sun) in which the hours differ from the exact ones, at least.
    stopped
        Why it cannot run here; the times are then zero.
    """

    name: str
    prepare_seconds: float
    seconds: float
    differ: int
    stopped: str | None = None


def run_sun(
    scene: Scene, sensors: ViewSamples, sky: Sky, comparators: Sequence[Runner[Any]], clock: Clock
) -> list[SunRun]:
    """Time `sun_study` on sensors `(n,)` on faces, then each comparator, which is asked about the facing sensors only.

    Call it once on a few sensors before, so that nothing is compiled while the time is taken.
    """
    watch = Clock()
    with clock.span("umbrae"):
        exact = sun_study(scene, sensors, sky, clock=watch)
    spent = watch.seconds()
    runs = [SunRun("umbrae", spent["prepare"], spent["sun"], 0)]
    steps = np.round(exact.hours / sky.step_hours).astype(np.int64)
    for runner in comparators:
        if reason := runner.unavailable():
            runs.append(SunRun(runner.name, 0.0, 0.0, 0, reason))
            continue
        with clock.span(runner.name):
            start = time.perf_counter()
            runner.set_geometry(scene)
            runner.prepare(Clock())
            middle = time.perf_counter()
            lit = _lit(scene, sensors, sky, runner, clock)
            end = time.perf_counter()
        runs.append(SunRun(runner.name, middle - start, end - middle, int(np.abs(lit - steps).sum())))
    return runs


def _lit(scene: Scene, sensors: ViewSamples, sky: Sky, runner: Runner[Any], clock: Clock) -> NDArray[np.int64]:
    normal = facets(scene)[0][sensors.triangle] * sensors.side[:, None]
    lit = np.zeros(sensors.shape, np.int64)
    suns = [light for light, day in zip(sky.lights, sky.is_day, strict=True) if day]
    for done, light in enumerate(suns, 1):
        facing = np.flatnonzero(normal @ light.position[:3].astype(np.float64) > 0.0)
        runner.set_samples(sensors.take(facing))
        lit[facing] += ~runner.mask(runner.shadow(light, Clock())).in_shadow
        clock.advance(done, len(suns))
    return lit
