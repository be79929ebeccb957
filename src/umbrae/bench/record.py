"""The JSON file of one benchmark run: what was measured, on what, with which results."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from umbrae.bench.case import Case
from umbrae.errors import InputError
from umbrae.files import load_text, save_text

SCHEMA = 1


@dataclass(frozen=True)
class Times:
    """The seconds of all runs in order, and what they come to."""

    runs: tuple[float, ...]
    minimum: float
    median: float
    quartiles: tuple[float, float]

    @classmethod
    def of(cls, runs: Sequence[float]) -> "Times":
        """The statistics of one run or more."""
        seconds = np.round(np.asarray(runs, np.float64), 7)
        low, middle, high = (float(value) for value in np.percentile(seconds, (25, 50, 75)))
        return cls(tuple(seconds.tolist()), float(seconds.min()), middle, (low, high))


@dataclass(frozen=True)
class RunnerResult:
    """What one runner did on one case.

    Attributes
    ----------
    not_run
        Why there is nothing else; None when it ran.
    checked, wrong
        How many samples were compared with the oracle, and how many of them differ outside the band.
    broken
        Whether that breaks the guarantee. There are no times then.
    seconds
        `build` (preparing new geometry), `trace` (the shadows right after), `cold` (both), and `warm` (the shadows
        of a new view and light with the geometry of the run before).
    stages
        Median seconds of each span on the clock in the cold runs.
    counters
        What the last cold mask counted.
    peak_bytes
        How far one more cold run let the process grow; None where that is not measured.
    """

    name: str
    guarantee: str
    options: Mapping[str, Any] = field(default_factory=dict)
    not_run: str | None = None
    checked: int = 0
    wrong: int = 0
    broken: bool = False
    seconds: Mapping[str, Times] = field(default_factory=dict)
    stages: Mapping[str, float] = field(default_factory=dict)
    counters: Mapping[str, int] = field(default_factory=dict)
    peak_bytes: int | None = None


@dataclass(frozen=True)
class CaseResult:
    """What all runners did on one case; `samples` and `covered` count those of the last view."""

    case: Case
    triangles: int = 0
    samples: int = 0
    covered: int = 0
    not_run: str | None = None
    runners: tuple[RunnerResult, ...] = ()

    def runner(self, name: str) -> RunnerResult | None:
        """The result of a runner by name, if it took part."""
        return next((runner for runner in self.runners if runner.name == name), None)


@dataclass(frozen=True)
class Record:
    """One benchmark: its configuration, the machine, and the cases finished so far."""

    benchmark: str
    configuration: Mapping[str, Any]
    machine: Mapping[str, Any]
    date: str
    cases: tuple[CaseResult, ...] = ()

    @property
    def broken(self) -> bool:
        """Whether some runner broke its guarantee."""
        return any(runner.broken for case in self.cases for runner in case.runners)

    def with_case(self, result: CaseResult) -> "Record":
        """With one more case, in place of an older result of the same."""
        others = tuple(one for one in self.cases if one.case != result.case)
        return dataclasses.replace(self, cases=(*others, result))

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"schema": SCHEMA, **dataclasses.asdict(self)}

    def save(self, path: Path) -> None:
        """Write the file, whole or not at all."""
        save_text(path, json.dumps(self.as_dict(), indent=1) + "\n")

    @classmethod
    def load(cls, path: Path) -> "Record":
        """Read what `save` wrote; raises `InputError` for anything else."""
        try:
            document = json.loads(load_text(path))
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: damaged, or no JSON: {error}") from error
        if not isinstance(document, dict) or document.get("schema") != SCHEMA:
            raise InputError(f"{path}: wanted a result of umbrae bench of schema {SCHEMA}")
        try:
            return _record(document)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: damaged: {type(error).__name__} {error}") from error

    def check_same(self, path: Path, earlier: "Record") -> None:
        """Refuse to go on with an earlier record that was measured otherwise, elsewhere, or with other sources."""
        ours = {"benchmark": self.benchmark, **self.configuration, **self.machine}
        theirs = {"benchmark": earlier.benchmark, **earlier.configuration, **earlier.machine}
        # A commit that leaves the sources as they are changes nothing.
        for name in (name for name in {**ours, **theirs} if name != "commit"):
            # Through JSON, where tuples are lists.
            mine, other = (json.dumps(side.get(name)) for side in (ours, theirs))
            if mine != other:
                raise InputError(f"{path}: cannot be resumed: it was made with {name} {other}, this is {mine}")


def _record(document: dict[str, Any]) -> Record:
    cases = []
    for case in document["cases"]:
        runners = [_runner(dict(runner)) for runner in case["runners"]]
        whole = {name: int(case[name]) for name in ("triangles", "samples", "covered")}
        cases.append(CaseResult(**{**case, **whole, "case": Case(**case["case"]), "runners": tuple(runners)}))
    known = {name: document[name] for name in ("benchmark", "configuration", "machine", "date")}
    return Record(
        str(known["benchmark"]), dict(known["configuration"]), dict(known["machine"]), str(known["date"]), tuple(cases)
    )


def _runner(values: dict[str, Any]) -> RunnerResult:
    values["seconds"] = {name: Times.of(times["runs"]) for name, times in values["seconds"].items()}
    if values["seconds"] and set(values["seconds"]) != {"build", "trace", "cold", "warm"}:
        raise ValueError(f"seconds of {', '.join(values['seconds'])}")
    if not values["seconds"] and values["not_run"] is None and not values["broken"]:
        raise ValueError(f"no seconds of {values['name']}")
    for name in ("checked", "wrong"):
        values[name] = int(values[name])
    if values["peak_bytes"] is not None:
        values["peak_bytes"] = int(values["peak_bytes"])
    return RunnerResult(**values)
