"""What is done with results: `umbrae bench report` and `umbrae bench compare`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from umbrae import files
from umbrae.bench.compare import FEWEST, LEAST, Comparison, different_machines
from umbrae.bench.compare import compare as compare_results
from umbrae.bench.report.merge import merged
from umbrae.bench.report.page import page
from umbrae.bench.report.pictures import pairs
from umbrae.bench.report.sections import section
from umbrae.bench.results import load_result
from umbrae.clock import Clock
from umbrae.console import ConsoleClock, note
from umbrae.options import Quiet

app = typer.Typer(rich_markup_mode=None)

FIRST = ("rays", "sun")
"""What comes before the papers' tables on the page; all else in the order of the files."""


@app.command()
def report(
    results: Annotated[list[Path], typer.Argument(metavar="FILE...", help="JSON files that other benchmarks wrote.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="HTML file to write.")],
    pictures: Annotated[
        bool, typer.Option("--pictures/--no-pictures", help="Make pictures of two methods to slide between.")
    ] = True,
    quiet: Quiet = False,
) -> None:
    """Put results on one page: tables, plots, pictures; it needs no other file and asks for none."""
    files.check_writable(output, (".html", ".htm"))
    sections = merged([section(load_result(path)) for path in dict.fromkeys(results)])
    sections.sort(key=lambda one: one.benchmark not in FIRST)
    shown = list(pairs(Clock() if quiet else ConsoleClock())) if pictures else []
    files.save_text(output, page(sections, shown))


@app.command()
def compare(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="JSON file of a benchmark.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="A later one of the same.")],
) -> None:
    """Tell what became slower by more than runs differ among themselves; exit status 1 if anything did."""
    before, after = load_result(old), load_result(new)
    found = compare_results(before, after)
    if different_machines(before, after):
        note(f"measured on different machines: {before.machine}; {after.machine}")
    _show(found, Console(highlight=False))
    if found.slower:
        raise typer.Exit(1)


def _show(found: Comparison, console: Console) -> None:
    changed = (*found.slower, *found.faster)
    if changed:
        rows = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        rows.add_column("", overflow="fold")
        for name in ("old ms", "new ms", "ratio"):
            rows.add_column(name, justify="right", no_wrap=True)
        for one in changed:
            rows.add_row(one.name, f"{1e3 * one.old:.2f}", f"{1e3 * one.new:.2f}", f"{one.ratio:.2f}")
        console.print(rows)
    if len(found.changes) > 2 and max(found.middle, 1 / found.middle) >= LEAST:
        side = "above" if found.middle > 1 else "below"
        console.print(
            f"half of all ratios are {side} {found.middle:.2f}: the machine may have been busy during one of the two",
            markup=False,
        )
    for name in found.gone:
        console.print(f"  {name}: not measured any more", markup=False)
    for name in found.few:
        console.print(f"  {name}: too few runs to tell, wanted {FEWEST}", markup=False)
    console.print(
        f"{len(found.slower)} slower, {len(found.faster)} faster, of {len(found.changes)}; the others within the "
        "spread of their runs",
        markup=False,
    )
