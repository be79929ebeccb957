"""A record on the screen: a table for each case, and one of what is wanted."""

from collections.abc import Iterator

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from umbrae.bench.bars import (
    BYTES_PER_SAMPLE,
    BYTES_PER_TRIANGLE,
    REFERENCE,
    WANTED_COLD,
    WANTED_GROWTH,
    WANTED_WARM,
    bars,
)
from umbrae.bench.case import Case
from umbrae.bench.record import CaseResult, Record, RunnerResult

_MIB = 1 << 20
_LEGEND = (
    "Median milliseconds; ± is half the distance between the quartiles. cold: build and trace; warm: trace with the "
    "geometry of the run before; wrong: share of the samples checked by the oracle; peak: MiB of one cold run."
)


def show(record: Record, console: Console) -> None:
    """Print everything, no wider than the console."""
    for result in record.cases:
        console.print(_heading(result), markup=False)
        if result.runners:
            console.print(_case(result))
        for runner in result.runners:
            if runner.not_run is not None:
                console.print(f"  {runner.name} not run: {runner.not_run}", markup=False)
        console.print()
    if any(result.runners for result in record.cases):
        console.print(_LEGEND, markup=False)
    heights = bars(record)
    if heights:
        console.print()
        console.print(_bars(record))
        console.print(
            f"cold, warm: times as fast as Embree (the {REFERENCE} row). memory: peak over {BYTES_PER_TRIANGLE} bytes "
            f"per triangle and {BYTES_PER_SAMPLE} per sample. growth: cold and warm time over those of "
            "a quarter of the pixels. ! misses what is wanted.",
            markup=False,
        )
    for text in broken(record):
        console.print(Text(text, style="bold red"))


def broken(record: Record) -> Iterator[str]:
    """One line for each broken guarantee."""
    for result in record.cases:
        for runner in result.runners:
            if runner.broken:
                yield (
                    f"WRONG: {runner.name} promises {runner.guarantee} verdicts, but {runner.wrong:,} of "
                    f"{runner.checked:,} samples of {result.case} differ from the oracle: no time"
                )


def _heading(result: CaseResult) -> str:
    case = result.case
    title = f"{case.scene}, {case.light} light, {case.width}x{case.height}"
    if result.not_run is not None:
        return f"{title}\n  not run: {result.not_run}"
    checked = max((runner.checked for runner in result.runners), default=0)
    return (
        f"{title}\n{result.triangles:,} triangles, {result.covered:,} of {result.samples:,} samples covered, "
        f"{checked:,} checked"
    )


def _case(result: CaseResult) -> Table:
    rows = _table()
    rows.add_column("", no_wrap=True)
    for name in ("build", "trace", "cold", "min", "±", "warm", "min", "±", "wrong", "peak"):
        rows.add_column(name, justify="right", no_wrap=True)
    for runner in result.runners:
        if runner.not_run is None:
            rows.add_row(escape(runner.name), *_times(runner), _wrong(runner), _peak(runner))
    return rows


def _times(runner: RunnerResult) -> Iterator[str | Text]:
    if runner.broken:
        yield Text("WRONG", style="bold red")
        yield from ["-"] * 7
        return
    for kind in ("build", "trace"):
        yield _milliseconds(runner.seconds[kind].median)
    for kind in ("cold", "warm"):
        times = runner.seconds[kind]
        spread = (times.quartiles[1] - times.quartiles[0]) / 2
        yield from (_milliseconds(seconds) for seconds in (times.median, times.minimum, spread))


def _wrong(runner: RunnerResult) -> Text:
    share = runner.wrong / max(1, runner.checked)
    text = "0" if runner.wrong == 0 else "<0.01%" if share < 5e-5 else f"{share:.2%}"
    return Text(text, style="bold red" if runner.broken else "")


def _peak(runner: RunnerResult) -> str:
    return "?" if runner.peak_bytes is None else f"{runner.peak_bytes / _MIB:,.0f}"


def _milliseconds(seconds: float) -> str:
    value = seconds * 1e3
    return f"{value:,.0f}" if value >= 100 else f"{value:.1f}"


def _bars(record: Record) -> Table:
    rows = _table()
    rows.add_column("", no_wrap=True)
    rows.add_column("", no_wrap=True)
    for name, wanted in (
        ("cold", f">= {WANTED_COLD:g}"),
        ("warm", f">= {WANTED_WARM:g}"),
        ("memory", "<= 1"),
        ("growth", f"< {WANTED_GROWTH:g}"),
    ):
        rows.add_column(f"{name}\n{wanted}", justify="right", no_wrap=True)
    for one in bars(record):
        rows.add_row(
            _short(one.case),
            escape(one.runner.name),
            _mark(one.cold, (one.cold or 0) >= WANTED_COLD),
            _mark(one.warm, (one.warm or 0) >= WANTED_WARM),
            _mark(one.memory, (one.memory or 0) <= 1),
            _growth(one.growth_cold, one.growth_warm),
        )
    return rows


def _growth(cold: float | None, warm: float | None) -> Text:
    if cold is None or warm is None:
        return Text("-")
    met = max(cold, warm) < WANTED_GROWTH
    return Text(f"{cold:.1f} {warm:.1f}{' ' if met else '!'}", style="" if met else "red")


def _mark(value: float | None, met: bool) -> Text:
    if value is None:
        return Text("- ")
    return Text(f"{value:.2f}{' ' if met else '!'}", style="" if met else "red")


def _short(case: Case) -> str:
    light = "sun" if case.light == "directional" else case.light
    return f"{case.scene} {light} {case.width}x{case.height}"


def _table() -> Table:
    return Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
