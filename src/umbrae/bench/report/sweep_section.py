"""A paper's table made anew as a section: values, ratios beside the paper's, curves."""

import re
from collections.abc import Sequence

from umbrae.bench.report.section import Curve, Grid, Plot, Section
from umbrae.bench.sweep import Quantity, SweepRecord


def sweep_section(record: SweepRecord, machine: str) -> Section:
    """What to show of a table."""
    sweep = record.sweep
    size = f", {sweep.size[0]} x {sweep.size[1]}" if sweep.size else ""
    grids, plots = [], []
    for quantity in sweep.quantities:
        grids.append(_values(record, quantity))
        if not quantity.comparable:
            grids.append(_ratios(record, quantity))
        plots += _curves(record, quantity)
    plots += _wrong_beside_time(record)
    wrong = [
        f"{cell.row}, {cell.column}: {cell.wrong:,} of {cell.checked:,} samples break the promise ({cell.guarantee})"
        for cell in record.cells
        if cell.broken
    ]
    skipped: dict[tuple[str, str], list[str]] = {}
    for cell in record.cells:
        if cell.not_run:
            skipped.setdefault((cell.row, cell.not_run), []).append(cell.column)
    notes = [sweep.note] if sweep.note else []
    notes += [f"{row} not run ({', '.join(columns)}): {reason}" for (row, reason), columns in skipped.items()]
    shown = tuple(grid for grid in grids if grid.rows)
    return Section(sweep.benchmark, f"{sweep.title} ({sweep.source}){size}", machine, shown, tuple(plots), notes, wrong)


def _values(record: SweepRecord, quantity: Quantity) -> Grid:
    """Our values; the paper's below them, if they mean the same here."""
    rows: list[tuple[str, ...]] = []
    dim = set()
    for row in record.rows:
        cells = [record.cell(row, column) for column in record.sweep.columns]
        ours = [None if cell is None else cell.value(quantity) for cell in cells]
        if any(value is not None for value in ours):
            rows.append((row, *_written(ours, quantity.form)))
        for device in record.devices if quantity.comparable else ():
            theirs = [record.paper_value(row, column, device, quantity) for column in record.sweep.columns]
            if any(value is not None for value in theirs):
                dim.add(len(rows))
                rows.append((f"paper: {device}", *_written(theirs, quantity.form)))
    head = (record.sweep.axis, *record.sweep.columns)
    return Grid(f"{quantity.name.capitalize()}, {quantity.unit}", head, rows, frozenset(dim))


def _ratios(record: SweepRecord, quantity: Quantity) -> Grid:
    """Ratios to the base, and the paper's below them."""
    rows: list[tuple[str, ...]] = []
    dim = set()
    for row in (row for row in record.rows if row != record.sweep.base):
        ours = [record.ratio(row, column, quantity) for column in record.sweep.columns]
        if any(value is not None for value in ours):
            rows.append((row, *_written(ours, "{:.2f}")))
        for device in record.devices:
            theirs = [record.paper_ratio(row, column, device, quantity) for column in record.sweep.columns]
            if any(value is not None for value in theirs):
                dim.add(len(rows))
                name = f"paper: {device}" if any(value is not None for value in ours) else f"{row}, paper: {device}"
                rows.append((name, *_written(theirs, "{:.2f}")))
    head = (record.sweep.axis, *record.sweep.columns)
    return Grid(f"{quantity.name.capitalize()} over that of {record.sweep.base}", head, rows, frozenset(dim))


def _written(values: Sequence[float | None], form: str) -> list[str]:
    return ["" if value is None else form.format(value) for value in values]


def _curves(record: SweepRecord, quantity: Quantity) -> list[Plot]:
    """A plot where all columns begin with a number: of triangles, objects, pixels."""
    numbers = {column: _number(column) for column in record.sweep.columns}
    if len(numbers) < 2 or None in numbers.values() or len(set(numbers.values())) < len(numbers):
        return []
    curves = []
    for row in record.rows:
        points = []
        for column, x in numbers.items():
            cell = record.cell(row, column)
            value = None if cell is None else cell.value(quantity)
            if x is not None and value is not None:
                points.append((x, value))
        curves.append(Curve(row, points))
    title = f"{quantity.name.capitalize()} over {record.sweep.axis}"
    return [Plot(title, record.sweep.axis, quantity.unit, curves)]


def _number(column: str) -> float | None:
    """What a column stands for: `96,002`, or the pixels of `800x600`; None for anything else."""
    text = column.replace(",", "").strip()
    size = re.fullmatch(r"(\d+)\s*x\s*(\d+)", text)
    if size:
        return float(int(size[1]) * int(size[2]))
    return float(text) if re.fullmatch(r"\d+(\.\d+)?", text) else None


def _wrong_beside_time(record: SweepRecord) -> list[Plot]:
    """Where anything is wrong: what share of the samples, beside the time."""
    if not any(cell.wrong for cell in record.cells):
        return []
    curves = [
        Curve(
            row,
            [
                (1e3 * cell.median, 100 * cell.wrong / cell.checked)
                for cell in record.cells
                if cell.row == row and cell.checked and cell.seconds
            ],
        )
        for row in record.rows
    ]
    return [
        Plot(
            "Wrong samples beside time",
            "milliseconds",
            "% of samples wrong",
            curves,
            joined=False,
            logarithmic=(True, False),
        )
    ]
