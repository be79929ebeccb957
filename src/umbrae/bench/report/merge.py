"""Results of the same benchmark from several machines, or days, beside each other."""

from collections.abc import Sequence
from dataclasses import replace
from string import ascii_uppercase

from umbrae.bench.report.section import Curve, Grid, Plot, Section

_Row = tuple[str, ...]


def merged(sections: Sequence[Section]) -> list[Section]:
    """One section for each benchmark and title, in order of their first."""
    groups: dict[tuple[str, str], list[Section]] = {}
    for section in sections:
        groups.setdefault((section.benchmark, section.title), []).append(section)
    return [group[0] if len(group) == 1 else _one(group) for group in groups.values()]


def letter(number: int) -> str:
    """A short name for a machine: A, B, ... Z, A1."""
    more, place = divmod(number, len(ascii_uppercase))
    return ascii_uppercase[place] + (str(more) if more else "")


def _one(sections: Sequence[Section]) -> Section:
    def told(lines: Sequence[Sequence[str]]) -> list[str]:
        return [f"{letter(number)}: {line}" for number, own in enumerate(lines) for line in own]

    captions = dict.fromkeys(grid.caption for section in sections for grid in section.grids)
    titles = dict.fromkeys(plot.title for section in sections for plot in section.plots)
    return replace(
        sections[0],
        machines=[machine for section in sections for machine in section.machines],
        grids=[
            _grid([next((grid for grid in one.grids if grid.caption == caption), None) for one in sections])
            for caption in captions
        ],
        plots=[
            _plot([next((plot for plot in one.plots if plot.title == title), None) for one in sections])
            for title in titles
        ],
        notes=list(dict.fromkeys(note for section in sections for note in section.notes)),
        missing=told([one.missing for one in sections]),
        wrong=told([one.wrong for one in sections]),
    )


def _grid(grids: Sequence[Grid | None]) -> Grid:
    """Rows of the same name below each other, one for each machine; what is quoted below them, once."""
    some = next(grid for grid in grids if grid is not None)
    columns = list(dict.fromkeys(name for grid in grids if grid is not None for name in grid.head[1:]))
    ours: dict[str, list[_Row]] = {}
    quoted: dict[str, dict[_Row, None]] = {}
    for number, grid in enumerate(grids):
        row_above = ""
        for place, row in enumerate(grid.rows if grid is not None else ()):
            assert grid is not None
            cells = dict(zip(grid.head[1:], row[1:], strict=True))
            values = tuple(cells.get(name, "") for name in columns)
            if place in grid.dim:
                quoted.setdefault(row_above, {})[row[0], "", *values] = None
            else:
                row_above = row[0]
                ours.setdefault(row_above, []).append((row_above, letter(number), *values))
    rows: list[_Row] = []
    dim: set[int] = set()
    for name in dict.fromkeys((*ours, *quoted)):
        rows += ours.get(name, [])
        dim.update(range(len(rows), len(rows) + len(quoted.get(name, ()))))
        rows += quoted.get(name, ())
    return Grid(some.caption, (some.head[0], "on", *columns), rows, frozenset(dim))


def _plot(plots: Sequence[Plot | None]) -> Plot:
    """The curves of all machines: the second one's with hollow markers, those of a third with others."""
    some = next(plot for plot in plots if plot is not None)
    names = list(dict.fromkeys(curve.name for plot in plots if plot is not None for curve in plot.curves))
    curves = [
        Curve(
            f"{curve.name}, {letter(number)}",
            curve.points,
            names.index(curve.name) + len(names) * (number // 2),
            hollow=number % 2 == 1,
        )
        for name in names
        for number, plot in enumerate(plots)
        for curve in (plot.curves if plot is not None else ())
        if curve.name == name
    ]
    return replace(some, curves=curves)
