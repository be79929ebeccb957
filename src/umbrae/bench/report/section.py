"""What a page shows of one result, whatever benchmark it is of: tables, curves, and notes."""

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Grid:
    """A table. The first cell of each row names it; `dim` rows are quoted from elsewhere."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    dim: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Curve:
    """A line of a plot, or points that are not joined; `points` are (x, y), all of them positive where axes are
    logarithmic."""

    name: str
    points: Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Plot:
    """Curves over an axis.

    Attributes
    ----------
    joined
        Whether the points of a curve are joined.
    logarithmic
        Whether both axes are, or (x, y) each.
    """

    title: str
    x: str
    y: str
    curves: Sequence[Curve]
    joined: bool = True
    logarithmic: tuple[bool, bool] = (True, True)


@dataclass(frozen=True)
class Section:
    """One result.

    Attributes
    ----------
    benchmark, title, machine
        The command's name, a heading, and what it ran on.
    wrong
        One line for each broken guarantee.
    """

    benchmark: str
    title: str
    machine: str
    grids: Sequence[Grid] = ()
    plots: Sequence[Plot] = ()
    notes: Sequence[str] = ()
    wrong: Sequence[str] = field(default_factory=tuple)
