"""The record of a paper's table made anew: methods (rows) at several sizes of something (columns)."""

import dataclasses
import datetime
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from umbrae.bench import machine
from umbrae.bench.record import SCHEMA
from umbrae.errors import InputError
from umbrae.files import load_text, save_text


@dataclass(frozen=True)
class Cell:
    """One row of a table in one of its columns.

    Attributes
    ----------
    seconds
        Of the shadows of each frame, in order.
    counters
        What the masks counted, the median over the frames.
    checked, wrong
        Samples of the last frame held against the oracle, and how many of them differ outside the band.
    not_run
        Why there is nothing else; None when it ran.
    """

    row: str
    column: str
    guarantee: str = ""
    seconds: tuple[float, ...] = ()
    counters: Mapping[str, int] = field(default_factory=dict)
    checked: int = 0
    wrong: int = 0
    not_run: str | None = None

    @property
    def broken(self) -> bool:
        """Whether the method broke what it promises; what promises nothing cannot."""
        return self.wrong > 0 and self.guarantee != "none"

    @property
    def median(self) -> float:
        """Seconds of the frame in the middle."""
        return float(np.median(self.seconds))


@dataclass(frozen=True)
class PaperRow:
    """What a paper tells of one row: `values` by column, in milliseconds a frame."""

    row: str
    device: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Sweep:
    """What a table is about, and what its paper tells.

    Attributes
    ----------
    benchmark, title, source
        The command's name, a heading, and where the paper has the table.
    axis, columns
        What changes from column to column, and its values in order.
    base
        The row to which ratios are given.
    size
        Pixels, where all columns have the same.
    note
        What a reader must know to compare: scenes that stand in for others, what is timed.
    """

    benchmark: str
    title: str
    source: str
    axis: str
    columns: tuple[str, ...]
    base: str
    paper: tuple[PaperRow, ...] = ()
    size: tuple[int, int] | None = None
    note: str = ""


@dataclass(frozen=True)
class SweepRecord:
    """A table measured, on what machine; `SweepRecord.of` stamps it."""

    sweep: Sweep
    machine: Mapping[str, Any]
    date: str
    cells: tuple[Cell, ...] = ()

    @classmethod
    def of(cls, sweep: Sweep, cells: Sequence[Cell]) -> "SweepRecord":
        """On this machine, now."""
        date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        return cls(sweep, machine.describe(), date, tuple(cells))

    @property
    def benchmark(self) -> str:
        """The command's name."""
        return self.sweep.benchmark

    @property
    def broken(self) -> bool:
        """Whether some method broke its guarantee."""
        return any(cell.broken for cell in self.cells)

    @property
    def rows(self) -> tuple[str, ...]:
        """All rows in order."""
        return tuple(dict.fromkeys(cell.row for cell in self.cells))

    def cell(self, row: str, column: str) -> Cell | None:
        """A cell that was measured."""
        return next((one for one in self.cells if (one.row, one.column) == (row, column) and one.not_run is None), None)

    def ratio(self, row: str, column: str) -> float | None:
        """The time of a row over that of the base, where both were measured."""
        one, base = self.cell(row, column), self.cell(self.sweep.base, column)
        return None if one is None or base is None else one.median / base.median

    def paper_ratio(self, row: str, column: str, device: str) -> float | None:
        """The same of the paper's device."""
        values = {one.row: one.values for one in self.sweep.paper if one.device == device}
        theirs, base = (values.get(name, {}).get(column) for name in (row, self.sweep.base))
        return None if theirs is None or not base else theirs / base

    @property
    def devices(self) -> tuple[str, ...]:
        """The paper's devices."""
        return tuple(dict.fromkeys(one.device for one in self.sweep.paper))

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"schema": SCHEMA, "benchmark": self.benchmark, **dataclasses.asdict(self)}

    def save(self, path: Path) -> None:
        """Write the file, whole or not at all."""
        save_text(path, json.dumps(self.as_dict(), indent=1) + "\n")

    @classmethod
    def load(cls, path: Path) -> "SweepRecord":
        """Read what `save` wrote; raises `InputError` for anything else."""
        try:
            document = json.loads(load_text(path))
            if document["schema"] != SCHEMA:
                raise InputError(f"{path}: wanted a result of umbrae bench of schema {SCHEMA}")
            sweep = dict(document["sweep"])
            paper = tuple(PaperRow(**row) for row in sweep.pop("paper"))
            size = sweep.pop("size")
            columns = tuple(sweep.pop("columns"))
            cells = tuple(Cell(**{**cell, "seconds": tuple(cell["seconds"])}) for cell in document["cells"])
            whole = Sweep(**sweep, columns=columns, paper=paper, size=tuple(size) if size else None)
            return cls(whole, dict(document["machine"]), str(document["date"]), cells)
        except InputError:
            raise
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: damaged, or no table of umbrae bench: {type(error).__name__} {error}") from error

    def show(self, console: Console) -> None:
        """Print milliseconds, ratios to the base beside the paper's, and what did not run."""
        sweep = self.sweep
        size = f", {sweep.size[0]}x{sweep.size[1]}" if sweep.size else ""
        console.print(f"{sweep.title} ({sweep.source}){size}", markup=False)
        rows = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        rows.add_column(sweep.axis, no_wrap=True)
        for column in sweep.columns:
            rows.add_column(column, justify="right", no_wrap=True)
        for row in self.rows:
            found = [self.cell(row, column) for column in sweep.columns]
            rows.add_row(f"{row}, ms", *("" if one is None else f"{1e3 * one.median:.1f}" for one in found))
        for row in (row for row in self.rows if row != sweep.base):
            ours = [self.ratio(row, column) for column in sweep.columns]
            rows.add_row(f"{row} / {sweep.base}", *(_ratio(value) for value in ours))
            for device in self.devices:
                theirs = [self.paper_ratio(row, column, device) for column in sweep.columns]
                if any(value is not None for value in theirs):
                    rows.add_row(Text(f"  {device}", style="dim"), *(_ratio(value) for value in theirs))
        console.print(rows)
        if sweep.note:
            console.print(sweep.note, markup=False)
        for text in dict.fromkeys(f"  {one.row} not run: {one.not_run}" for one in self.cells if one.not_run):
            console.print(text, markup=False)
        for one in self.cells:
            if one.broken:
                console.print(
                    f"WRONG: {one.row} promises {one.guarantee} verdicts, but {one.wrong:,} of {one.checked:,} samples "
                    f"of {one.column} differ from the oracle",
                    markup=False,
                )


def _ratio(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
