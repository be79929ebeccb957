"""Two results of one benchmark: what became slower, or faster, by more than runs differ among themselves."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from umbrae.bench.results import Result
from umbrae.errors import InputError


class Change(NamedTuple):
    """One thing that was measured twice: median seconds, and whether the middle halves of both runs lie apart."""

    name: str
    old: float
    new: float
    beyond: bool

    @property
    def ratio(self) -> float:
        """New over old."""
        return self.new / self.old

    @property
    def slower(self) -> bool:
        """Whether it takes longer, and not by chance."""
        return self.beyond and self.new > self.old


def changes(old: Result, new: Result) -> Iterator[Change]:
    """All that both results have times of, in the order of the new one.

    Raises
    ------
    InputError
        For results of different benchmarks, or that have nothing in common.
    """
    if old.benchmark != new.benchmark:
        raise InputError(f"{new.path} is of {new.benchmark}, {old.path} of {old.benchmark}: wanted the same benchmark")
    before, after = old.times(), new.times()
    if not before.keys() & after.keys():
        raise InputError(f"{new.path} and {old.path} have no measurement in common")
    for name, seconds in after.items():
        if name in before:
            low, middle, high = np.percentile(seconds, (25, 50, 75))
            old_low, old_middle, old_high = np.percentile(before[name], (25, 50, 75))
            yield Change(name, float(old_middle), float(middle), bool(low > old_high or high < old_low))
