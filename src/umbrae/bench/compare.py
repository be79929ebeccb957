"""Two results of one benchmark: what became slower, or faster, by more than runs differ among themselves."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.bench.results import Result
from umbrae.errors import InputError

LEAST = 1.05
"""Ratios nearer to 1 count as the same, however steady the runs of each process are: a choice."""
MOST_FRAMES = 0.9
"""Share of the frames that a change shows in, where frames differ in what there is to do."""
FEWEST = 3
"""Runs from which a spread can be told."""


class Change(NamedTuple):
    """One thing that was measured twice: median seconds, their ratio, and whether it is beyond the spread.

    Of a flight, `ratio` is the median over the frames, each of which has its counterpart.
    """

    name: str
    old: float
    new: float
    ratio: float
    beyond: bool

    @property
    def slower(self) -> bool:
        """Whether it takes longer, and not by chance."""
        return self.beyond and self.ratio > 1


@dataclass(frozen=True)
class Comparison:
    """What two results have in common, in the order of the new one.

    Attributes
    ----------
    changes
        Of all that can be told.
    few
        Names of what has too few runs to tell.
    gone
        Names of what the old one alone has times of.
    """

    changes: tuple[Change, ...]
    few: tuple[str, ...]
    gone: tuple[str, ...]

    @property
    def slower(self) -> tuple[Change, ...]:
        """The worst first."""
        return tuple(sorted((one for one in self.changes if one.slower), key=lambda one: -one.ratio))

    @property
    def faster(self) -> tuple[Change, ...]:
        """The best last."""
        found = (one for one in self.changes if one.beyond and not one.slower)
        return tuple(sorted(found, key=lambda one: -one.ratio))

    @property
    def middle(self) -> float:
        """The median of all ratios: far from 1, the machine itself was slower or faster."""
        return float(np.median([one.ratio for one in self.changes])) if self.changes else 1.0


def compare(old: Result, new: Result) -> Comparison:
    """Hold two results against each other.

    Raises
    ------
    InputError
        For results of different benchmarks, without times, or that have nothing in common.
    """
    if old.benchmark != new.benchmark:
        raise InputError(f"{new.path} is of {new.benchmark}, {old.path} of {old.benchmark}: wanted the same benchmark")
    before, after = old.times(), new.times()
    for result, times in ((old, before), (new, after)):
        if not times:
            raise InputError(f"{result.path}: {result.benchmark} has no times to compare")
    both = [name for name in after if name in before]
    if not both:
        raise InputError(f"{new.path} and {old.path} have no measurement in common")
    few = tuple(name for name in both if min(len(before[name]), len(after[name])) < FEWEST)
    changes = (
        _change(name, np.array(before[name]), np.array(after[name]), new.frames) for name in both if name not in few
    )
    return Comparison(tuple(changes), few, tuple(name for name in before if name not in after))


def different_machines(old: Result, new: Result) -> bool:
    """Whether times do not compare; OpenGL's driver counts where both used one."""
    ours, theirs = (result.document["machine"] for result in (new, old))
    if any(ours.get(name) != theirs.get(name) for name in ("cpu", "cores", "threads")):
        return True
    drivers = {one["opengl"] for one in (ours, theirs) if one.get("opengl")}
    return len(drivers) > 1


def _change(name: str, old: NDArray[np.float64], new: NDArray[np.float64], frames: bool) -> Change:
    if frames and len(old) == len(new):
        ratios = new / old
        ratio = float(np.median(ratios))
        apart = max(np.mean(ratios > 1), np.mean(ratios < 1)) >= MOST_FRAMES
    else:
        ratio = float(np.median(new) / np.median(old))
        (low, high), (old_low, old_high) = (np.percentile(seconds, (25, 75)) for seconds in (new, old))
        apart = low > old_high or high < old_low
    return Change(
        name, float(np.median(old)), float(np.median(new)), ratio, bool(apart and max(ratio, 1 / ratio) >= LEAST)
    )
