"""What is done with results: `umbrae bench report` and `umbrae bench compare`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from umbrae import files
from umbrae.bench.compare import changes
from umbrae.bench.report.merge import merged
from umbrae.bench.report.page import page
from umbrae.bench.report.pictures import pairs
from umbrae.bench.report.sections import section
from umbrae.bench.results import load_result
from umbrae.clock import Clock
from umbrae.console import ConsoleClock, note
from umbrae.options import Quiet

app = typer.Typer(rich_markup_mode=None)


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
    shown = list(pairs(Clock() if quiet else ConsoleClock())) if pictures else []
    files.save_text(output, page(sections, shown))


@app.command()
def compare(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="JSON file of a benchmark.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="A later one of the same.")],
) -> None:
    """Tell what became slower by more than runs differ among themselves; exit status 1 if anything did."""
    before, after = load_result(old), load_result(new)
    found = list(changes(before, after))
    if before.document["machine"]["cpu"] != after.document["machine"]["cpu"] or (
        before.document["machine"].get("opengl") != after.document["machine"].get("opengl")
    ):
        note(f"measured on different machines: {before.machine}; {after.machine}")
    slower = [change for change in found if change.slower]
    faster = [change for change in found if change.beyond and not change.slower]
    console = Console(highlight=False)
    if slower or faster:
        rows = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        rows.add_column("", overflow="fold")
        for name in ("old ms", "new ms", "ratio"):
            rows.add_column(name, justify="right", no_wrap=True)
        for change in sorted((*slower, *faster), key=lambda change: -change.ratio):
            rows.add_row(change.name, f"{1e3 * change.old:.2f}", f"{1e3 * change.new:.2f}", f"{change.ratio:.2f}")
        console.print(rows)
    console.print(
        f"{len(slower)} slower, {len(faster)} faster, of {len(found)}; all others within the spread of their runs"
    )
    if slower:
        raise typer.Exit(1)
