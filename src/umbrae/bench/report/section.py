"""What a page shows of one benchmark, whichever it is: tables, curves, and notes."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Grid:
    """A table. The first cell of each row names it; `dim` rows are quoted from elsewhere, about the row above."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    dim: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Curve:
    """A line of a plot, or points that are not joined.

    Attributes
    ----------
    points
        (x, y) of each.
    number
        Chooses colour, marker and dashes; the place among the plot's curves by default.
    hollow
        Whether the markers are: the same thing on another machine.
    """

    name: str
    points: Sequence[tuple[float, float]]
    number: int | None = None
    hollow: bool = False


@dataclass(frozen=True)
class Plot:
    """Curves over an axis; `x` and `y` name the axes, `joined` tells whether the points of a curve are."""

    title: str
    x: str
    y: str
    curves: Sequence[Curve]
    joined: bool = True


@dataclass(frozen=True)
class Section:
    """One result, or several of one benchmark.

    Attributes
    ----------
    benchmark, title, machines
        The command's name, a heading, and what it ran on, a line each.
    notes
        What a reader must know.
    missing
        One line for each thing that did not run.
    wrong
        One line for each broken guarantee.
    """

    benchmark: str
    title: str
    machines: Sequence[str]
    grids: Sequence[Grid] = ()
    plots: Sequence[Plot] = ()
    notes: Sequence[str] = ()
    missing: Sequence[str] = ()
    wrong: Sequence[str] = ()
