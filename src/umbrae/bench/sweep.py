"""The record of a paper's table made anew: methods (rows) at several sizes of something (columns)."""

import dataclasses
import datetime
import json
from collections.abc import Callable, Mapping, Sequence
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
class Quantity:
    """What a table tells of its cells: the time of a frame, or a sum of counters.

    Attributes
    ----------
    name, unit
        For headings and for the paper's rows.
    scale
        How many seconds, or counted things, one unit is.
    counters
        Which counters are added up, of those that a method has; none for the time.
    comparable
        Whether the paper's values mean the same on another machine, as bytes do. They stand beside ours then; of all
        others only ratios do.
    """

    name: str
    unit: str
    scale: float
    counters: tuple[str, ...] = ()
    comparable: bool = False

    @property
    def form(self) -> str:
        """How to write a value."""
        return "{:.2f}" if self.counters else "{:.1f}"


TIME = Quantity("time", "ms", 1e-3)


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

    def value(self, quantity: Quantity) -> float | None:
        """So many units of a quantity; None where nothing of it was measured."""
        if self.not_run is not None:
            return None
        if not quantity.counters:
            return self.median / quantity.scale if self.seconds else None
        found = [self.counters[name] for name in quantity.counters if name in self.counters]
        return sum(found) / quantity.scale if found else None


@dataclass(frozen=True)
class PaperRow:
    """What a paper tells of one row: `values` by column, in units of the table's quantity of that name."""

    row: str
    device: str
    values: Mapping[str, float]
    quantity: str = TIME.name


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
    quantities
        What is told of the cells, the main thing first.
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
    quantities: tuple[Quantity, ...] = (TIME,)


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

    def ratio(self, row: str, column: str, quantity: Quantity | None = None) -> float | None:
        """A row's value over that of the base, where both were measured; of the first quantity by default."""
        quantity = quantity or self.sweep.quantities[0]
        one, base = (self.cell(name, column) for name in (row, self.sweep.base))
        ours, theirs = (None if cell is None else cell.value(quantity) for cell in (one, base))
        return None if ours is None or not theirs else ours / theirs

    def paper_value(self, row: str, column: str, device: str, quantity: Quantity | None = None) -> float | None:
        """What the paper tells of a device, in units of the quantity."""
        name = (quantity or self.sweep.quantities[0]).name
        told = (one for one in self.sweep.paper if (one.row, one.device, one.quantity) == (row, device, name))
        return next((one.values[column] for one in told if column in one.values), None)

    def paper_ratio(self, row: str, column: str, device: str, quantity: Quantity | None = None) -> float | None:
        """The ratio of the paper's device."""
        theirs, base = (self.paper_value(name, column, device, quantity) for name in (row, self.sweep.base))
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
            quantities = tuple(
                Quantity(**{**one, "counters": tuple(one["counters"])}) for one in sweep.pop("quantities")
            )
            cells = tuple(Cell(**{**cell, "seconds": tuple(cell["seconds"])}) for cell in document["cells"])
            whole = Sweep(
                **sweep, columns=columns, paper=paper, size=tuple(size) if size else None, quantities=quantities
            )
            return cls(whole, dict(document["machine"]), str(document["date"]), cells)
        except InputError:
            raise
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: damaged, or no table of umbrae bench: {type(error).__name__} {error}") from error

    def show(self, console: Console) -> None:
        """Print each quantity, ratios to the base and the paper's beside them, and what did not run."""
        sweep = self.sweep
        size = f", {sweep.size[0]}x{sweep.size[1]}" if sweep.size else ""
        console.print(f"{sweep.title} ({sweep.source}){size}", markup=False)
        for quantity in sweep.quantities:
            columns = list(sweep.columns)
            while columns:
                count = len(columns)
                while count > 1 and self._width(console, quantity, columns[:count]) > console.width:
                    count -= 1
                console.print(self._table(quantity, columns[:count]))
                columns = columns[count:]
        if sweep.note:
            console.print(sweep.note, markup=False)
        for reason in dict.fromkeys(one.not_run for one in self.cells if one.not_run):
            rows = dict.fromkeys(one.row for one in self.cells if one.not_run == reason)
            console.print(f"  {'; '.join(rows)} not run: {reason}", markup=False)
        for one in self.cells:
            if one.broken:
                console.print(
                    f"WRONG: {one.row} promises {one.guarantee} verdicts, but {one.wrong:,} of {one.checked:,} samples "
                    f"of {one.column} differ from the oracle",
                    markup=False,
                )

    def _width(self, console: Console, quantity: Quantity, columns: Sequence[str]) -> int:
        """Characters that a table of these columns would take."""
        table = self._table(quantity, columns)
        # Within its own options a console takes nothing for wider than itself.
        return console.measure(table, options=console.options.update(width=100_000)).maximum

    def _table(self, quantity: Quantity, columns: Sequence[str]) -> Table:
        """A quantity of all rows, then their ratios; values instead, if the paper's can be compared as they are.

        Of some of the columns: as many as fit side by side.
        """
        sweep = self.sweep
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column(sweep.axis, no_wrap=True)
        for column in columns:
            table.add_column(column, justify="right", no_wrap=True)

        def add(name: str, ours: Sequence[float | None], told: Callable[..., float | None], form: str) -> None:
            lines: list[tuple[str | Text, Sequence[float | None]]] = [(name, ours)]
            for device in self.devices:
                theirs = [told(row, column, device, quantity) for column in columns]
                if any(value is not None for value in theirs):
                    lines.append((Text(f"  {device}", style="dim"), theirs))
            if len(lines) > 1 or any(value is not None for value in ours):
                for line, values in lines:
                    table.add_row(line, *("" if value is None else form.format(value) for value in values))

        values = self.paper_value if quantity.comparable else lambda *_: None
        for row in self.rows:
            cells = [self.cell(row, column) for column in columns]
            ours = [None if cell is None else cell.value(quantity) for cell in cells]
            add(f"{row}, {quantity.unit}", ours, values, quantity.form)
        for row in (row for row in self.rows if row != sweep.base and not quantity.comparable):
            ratios = [self.ratio(row, column, quantity) for column in columns]
            add(f"{row} / {sweep.base}", ratios, self.paper_ratio, "{:.2f}")
        return table
