"""How high Umbrae jumps: each exact method beside Embree, and what the project wants of it."""

from dataclasses import dataclass, replace

from umbrae.bench.case import Case
from umbrae.bench.record import CaseResult, Record, RunnerResult

REFERENCE = "mitsuba"
WANTED_COLD, WANTED_WARM, WANTED_GROWTH = 5.0, 1.0, 2.0
"""Times as fast as Embree with new geometry and with prepared geometry; time for four times as many pixels."""
BYTES_PER_TRIANGLE, BYTES_PER_SAMPLE = 100, 40
"""The memory that the shadow stage may take."""


@dataclass(frozen=True)
class Bars:
    """One exact runner on one case, as ratios; None where something to compare with is missing.

    Attributes
    ----------
    cold, warm
        Embree's median time over the runner's, with and without building.
    memory
        Share of the allowed bytes that the peak takes.
    growth_cold, growth_warm
        Median time over that of the same case at half the width and height.
    """

    case: Case
    runner: RunnerResult
    cold: float | None
    warm: float | None
    memory: float | None
    growth_cold: float | None
    growth_warm: float | None


def bars(record: Record) -> list[Bars]:
    """Of all exact runners that ran, in the record's order."""
    return [
        Bars(
            result.case,
            runner,
            _ratio(result.runner(REFERENCE), runner, "cold"),
            _ratio(result.runner(REFERENCE), runner, "warm"),
            runner.peak_bytes / allowed_bytes(result) if runner.peak_bytes is not None else None,
            *(_ratio(runner, _half(record, result.case, runner.name), kind) for kind in ("cold", "warm")),
        )
        for result in record.cases
        for runner in result.runners
        if runner.guarantee == "exact" and runner.not_run is None
    ]


def allowed_bytes(result: CaseResult) -> int:
    """What the shadow stage may take at its peak."""
    return BYTES_PER_TRIANGLE * result.triangles + BYTES_PER_SAMPLE * result.samples


def _ratio(numerator: RunnerResult | None, denominator: RunnerResult | None, kind: str) -> float | None:
    if numerator is None or denominator is None or kind not in numerator.seconds or kind not in denominator.seconds:
        return None
    return numerator.seconds[kind].median / denominator.seconds[kind].median


def _half(record: Record, case: Case, runner: str) -> RunnerResult | None:
    half = replace(case, width=case.width // 2, height=case.height // 2)
    return next((result.runner(runner) for result in record.cases if result.case == half), None)
