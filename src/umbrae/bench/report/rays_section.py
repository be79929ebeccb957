"""Exact shadows beside rays as a section: how many times as fast, times, wrong samples, memory."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from umbrae.bench import table
from umbrae.bench.bars import REFERENCE, bars
from umbrae.bench.case import Case
from umbrae.bench.record import CaseResult, Record, RunnerResult
from umbrae.bench.report.section import Curve, Grid, Plot, Section

_KINDS = ("cold", "warm")
_MIB = 1 << 20
_NOTE = (
    "Cold: geometry new in every run, its preparation included. Warm: camera and light new. Memory: how far one cold "
    "run lets the process grow."
)


def rays_section(record: Record, machine: str) -> Section:
    """What to show of a record of `umbrae bench rays`."""
    ran = [_Ran(result, runner) for result in record.cases for runner in result.runners if runner.not_run is None]
    grids = [
        _gains(record),
        *(_grid(f"{kind.capitalize()}, ms", ran, lambda one, kind=kind: one.time(kind), "{:.1f}") for kind in _KINDS),  # type: ignore[misc]
        _grid("Wrong samples, % of those checked", ran, lambda one: one.wrong, "{:.3f}"),
        _grid("Peak memory, MiB", ran, lambda one: one.peak, "{:,.0f}"),
    ]
    missing = [(_name(result.case), result.not_run) for result in record.cases]
    missing += [(runner.name, runner.not_run) for result in record.cases for runner in result.runners]
    return Section(
        record.benchmark,
        "Exact shadows beside rays",
        [machine],
        [grid for grid in grids if grid.rows],
        _plots(ran),
        [_NOTE],
        list(dict.fromkeys(f"{name} not run: {reason}" for name, reason in missing if reason)),
        list(table.broken(record)),
    )


@dataclass(frozen=True)
class _Ran:
    """A runner on a case, and what to tell of it; None where there is nothing."""

    result: CaseResult
    runner: RunnerResult

    def time(self, kind: str) -> float | None:
        """Milliseconds; none where a promise is broken."""
        return 1e3 * self.runner.seconds[kind].median if kind in self.runner.seconds else None

    @property
    def wrong(self) -> float | None:
        """Per cent."""
        return 100 * self.runner.wrong / self.runner.checked if self.runner.checked else None

    @property
    def peak(self) -> float | None:
        """MiB."""
        return None if self.runner.peak_bytes is None else self.runner.peak_bytes / _MIB


def _name(case: Case) -> str:
    return f"{case.scene}, {case.light}, {case.width}x{case.height}"


def _gains(record: Record) -> Grid:
    rows: dict[str, dict[str, str]] = {}
    for one in bars(record):
        for kind, gain in zip(_KINDS, (one.cold, one.warm), strict=True):
            if gain is not None:
                rows.setdefault(_name(one.case), {})[f"{one.runner.name}, {kind}"] = f"{gain:.2f}"
    return _filled(f"Times as fast as Embree ({REFERENCE})", rows)


def _grid(caption: str, ran: Sequence[_Ran], tell: Callable[[_Ran], float | None], form: str) -> Grid:
    """A row for each case, a column for each runner."""
    rows: dict[str, dict[str, str]] = {}
    for one in ran:
        value = tell(one)
        if value is not None:
            rows.setdefault(_name(one.result.case), {})[one.runner.name] = form.format(value)
    return _filled(caption, rows)


def _filled(caption: str, rows: dict[str, dict[str, str]]) -> Grid:
    columns = dict.fromkeys(name for cells in rows.values() for name in cells)
    filled = [(row, *(cells.get(name, "") for name in columns)) for row, cells in rows.items()]
    return Grid(caption, ("case", *columns), filled)


def _plots(ran: Sequence[_Ran]) -> list[Plot]:
    plots = []
    for light, width in dict.fromkeys((one.result.case.light, one.result.case.width) for one in ran):
        chosen = [one for one in ran if (one.result.case.light, one.result.case.width) == (light, width)]
        if len({one.result.triangles for one in chosen}) > 1:
            curves = _curves(chosen, lambda one: float(one.result.triangles), lambda one: one.time("cold"))
            title = f"Time over triangles, cold: {light} light, {width:,} pixels wide"
            plots.append(Plot(title, "triangles", "milliseconds", curves, joined=False))
    if any(one.wrong for one in ran):
        curves = _curves(ran, lambda one: one.time("cold"), lambda one: one.wrong)
        plots.append(
            Plot("Wrong samples beside time, all cases", "milliseconds, cold", "% of samples wrong", curves, False)
        )
    return plots


def _curves(ran: Sequence[_Ran], x: Callable[[_Ran], float | None], y: Callable[[_Ran], float | None]) -> list[Curve]:
    """One for each runner."""
    points: dict[str, list[tuple[float, float]]] = {}
    for one in ran:
        across, up = x(one), y(one)
        if across is not None and up is not None:
            points.setdefault(one.runner.name, []).append((across, up))
    return [Curve(name, sorted(found)) for name, found in points.items()]
