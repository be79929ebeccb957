"""A paper's table made anew as a section: values, ratios beside the paper's, curves."""

import re
from collections.abc import Callable, Iterator, Sequence

from umbrae.bench.report.section import Curve, Grid, Plot, Section
from umbrae.bench.sweep import TIME, Cell, Quantity, SweepRecord


def sweep_section(record: SweepRecord, machine: str) -> Section:
    """What to show of a table."""
    sweep = record.sweep
    size = f", {sweep.size[0]} x {sweep.size[1]}" if sweep.size else ""
    grids: list[Grid] = []
    plots: list[Plot] = []
    for quantity in sweep.quantities:
        grids.append(_values(record, quantity))
        if not quantity.comparable:
            grids.append(_ratios(record, quantity))
        plots += _curves(record, quantity)
    if any(cell.wrong and cell.seconds for cell in record.cells):
        grids.append(_wrong(record))
        plots.append(_wrong_beside_time(record))
    skipped: dict[tuple[str, str], list[str]] = {}
    for cell in record.cells:
        if cell.not_run:
            skipped.setdefault((cell.row, cell.not_run), []).append(cell.column)
    return Section(
        sweep.benchmark,
        f"{sweep.title} ({sweep.source}){size}",
        [machine],
        [grid for grid in grids if grid.rows],
        plots,
        [sweep.note] if sweep.note else [],
        [f"{row} not run ({', '.join(columns)}): {reason}" for (row, reason), columns in skipped.items()],
        [
            f"{cell.row}, {cell.column}: {cell.wrong:,} of {cell.checked:,} samples break the promise "
            f"({cell.guarantee})"
            for cell in record.cells
            if cell.broken
        ],
    )


def _values(record: SweepRecord, quantity: Quantity) -> Grid:
    """Our values; the paper's below them, if they mean the same here."""
    rows: list[tuple[str, ...]] = []
    dim = set()
    for row in record.rows:
        ours = _of_row(record, row, lambda cell: cell.value(quantity))
        theirs = list(_told(record, row, record.paper_value, quantity)) if quantity.comparable else []
        if any(value is not None for value in ours) or theirs:
            rows.append((row, *_written(ours, quantity.form)))
        for device, values in theirs:
            dim.add(len(rows))
            rows.append((f"paper: {device}", *_written(values, quantity.form)))
    return _grid(record, f"{_capital(quantity.name)}, {quantity.unit}", rows, dim)


def _ratios(record: SweepRecord, quantity: Quantity) -> Grid:
    """Ratios to the base, and the paper's below them."""
    rows: list[tuple[str, ...]] = []
    dim = set()
    for row in (row for row in record.rows if row != record.sweep.base):
        ours = [record.ratio(row, column, quantity) for column in record.sweep.columns]
        theirs = list(_told(record, row, record.paper_ratio, quantity))
        if any(value is not None for value in ours) or theirs:
            rows.append((row, *_written(ours, "{:.2f}")))
        for device, values in theirs:
            dim.add(len(rows))
            rows.append((f"paper: {device}", *_written(values, "{:.2f}")))
    return _grid(record, f"{_capital(quantity.name)} over that of {record.sweep.base}", rows, dim)


def _told(
    record: SweepRecord, row: str, find: Callable[..., float | None], quantity: Quantity
) -> Iterator[tuple[str, Sequence[float | None]]]:
    """What the paper tells of a row, by device."""
    for device in record.devices:
        values = [find(row, column, device, quantity) for column in record.sweep.columns]
        if any(value is not None for value in values):
            yield device, values


def _wrong(record: SweepRecord) -> Grid:
    rows = []
    for row in record.rows:
        shares = _of_row(record, row, lambda cell: 100 * cell.wrong / cell.checked if cell.checked else None)
        if any(share is not None for share in shares):
            rows.append((row, *_written(shares, "{:.3f}")))
    return _grid(record, "Wrong samples, % of those checked", rows, set())


def _of_row(record: SweepRecord, row: str, value: Callable[[Cell], float | None]) -> list[float | None]:
    cells = [record.cell(row, column) for column in record.sweep.columns]
    return [None if cell is None else value(cell) for cell in cells]


def _grid(record: SweepRecord, caption: str, rows: Sequence[Sequence[str]], dim: set[int]) -> Grid:
    return Grid(caption, (record.sweep.axis, *record.sweep.columns), rows, frozenset(dim))


def _capital(name: str) -> str:
    return name[:1].upper() + name[1:]


def _written(values: Sequence[float | None], form: str) -> list[str]:
    return ["" if value is None else form.format(value) for value in values]


def _curves(record: SweepRecord, quantity: Quantity) -> Iterator[Plot]:
    """A plot of all columns that are numbers, or one for each word that stands before several numbers."""
    groups: dict[tuple[str, str], dict[float, str]] = {}
    last = re.split(r", | and ", record.sweep.axis)[-1]
    for column in record.sweep.columns:
        place = _place(column)
        if place is not None:
            group, x, of_size = place
            # Where all columns have the same pixels, A x B are so many things.
            axis = "pixels" if of_size and record.sweep.size is None else last
            groups.setdefault((group, axis), {})[x] = column
    for (group, axis), columns in groups.items():
        curves = []
        for row in record.rows:
            cells = [(x, record.cell(row, column)) for x, column in sorted(columns.items())]
            values = [(x, cell.value(quantity)) for x, cell in cells if cell is not None]
            points = [(x, value) for x, value in values if value is not None]
            if points:
                curves.append(Curve(row, points))
        if any(len(curve.points) > 1 for curve in curves):
            title = f"{_capital(quantity.name)} over {axis}{', ' if group else ''}{group}"
            yield Plot(title, axis, quantity.unit, curves)


def _place(column: str) -> tuple[str, float, bool] | None:
    """The word before a column's number, the number, and whether it is of the pixels of a size.

    `10x10 96,002`, `96002` and `city 800x600` have one; None for what has none.
    """
    found = re.fullmatch(r"(?:(.*\S)\s+)?(\d[\d,]*(?:\.\d+)?)(?:\s*x\s*(\d+))?", column.strip())
    if found is None:
        return None
    group, number, height = found.groups()
    return group or "", float(number.replace(",", "")) * float(height or 1), height is not None


def _wrong_beside_time(record: SweepRecord) -> Plot:
    """What share of the samples is wrong, and how long it took."""
    curves = []
    for row in record.rows:
        cells = [cell for cell in record.cells if cell.row == row and cell.checked and cell.seconds]
        points = [(cell.median / TIME.scale, 100 * cell.wrong / cell.checked) for cell in cells]
        if points:
            curves.append(Curve(row, points))
    return Plot("Wrong samples beside time", "milliseconds", "% of samples wrong", curves, joined=False)
