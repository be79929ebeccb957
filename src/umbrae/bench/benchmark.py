"""Carrying a benchmark out: case after case, what is finished kept on disk."""

import datetime
import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from umbrae.bench import machine
from umbrae.bench.case import cases, views
from umbrae.bench.flythrough import FlyThrough
from umbrae.bench.measure import measure
from umbrae.bench.record import CaseResult, Record
from umbrae.bench.runner import Runner
from umbrae.bench.scenes import SCENES
from umbrae.clock import Clock
from umbrae.errors import CapacityError, ModelError
from umbrae.scene import Scene


@dataclass(frozen=True)
class Benchmark:
    """What is to be measured.

    Attributes
    ----------
    scenes, lights, sizes
        Names from `SCENES` and `LIGHTS`, and picture sizes in pixels: their combinations are the cases.
    runs
        Timed runs of each case, after a warm-up.
    checked
        Samples of each case and runner that are compared with the oracle.
    runners
        Who takes part.
    models
        The folder that holds the models.
    path
        Key frames that the camera flies along, one frame a run.
    """

    scenes: Sequence[str]
    lights: Sequence[str]
    sizes: Sequence[tuple[int, int]]
    runs: int
    checked: int
    runners: Sequence[Runner[Any]]
    models: Path | None = None
    path: FlyThrough | None = None

    def record(self) -> Record:
        """An empty record of this benchmark on this machine."""
        configuration = {
            "scenes": list(self.scenes),
            "lights": list(self.lights),
            "sizes": [list(size) for size in self.sizes],
            "runs": self.runs,
            "checked": self.checked,
            "runners": [runner.name for runner in self.runners],
            "path": None if self.path is None else {"name": self.path.name, "keys": self.path.keys.tolist()},
        }
        date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        return Record("rays", configuration, machine.describe(), date)

    def run(self, record: Record, keep: Callable[[Record], None], clock: Clock) -> Record:
        """Measure the cases that the record does not hold yet; `keep` hears of the record after each."""
        finished = {result.case for result in record.cases if result.not_run is None}
        scene: Scene | None = None
        loaded = ""
        for case in cases(self.scenes, self.lights, self.sizes):
            if case in finished:
                continue
            try:
                if case.scene != loaded:
                    scene, loaded = None, case.scene
                    with clock.span(f"load {case.scene}"):
                        scene = SCENES[case.scene].load(self.models)
                if scene is not None:
                    seen = views(case, scene, self.runs, self.path)
                    with clock.span(str(case)):
                        result = measure(case, scene, seen, self.runners, self.checked, clock)
            except (ModelError, CapacityError) as error:
                result = CaseResult(case, not_run=str(error))
                loaded = ""
            gc.collect()
            record = record.with_case(result)
            keep(record)
        return record
