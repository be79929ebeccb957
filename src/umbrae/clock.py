"""Where the time goes: named spans that whoever does the work marks and whoever asked for it reads."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Clock:
    """Collects how long each named span took and hears how far it has come; a face may override the three hooks.

    `spans` is a list of `(name, seconds)` in order of completion. A name may occur more than once.
    """

    def __init__(self) -> None:
        self.spans: list[tuple[str, float]] = []

    @contextmanager
    def span(self, name: str) -> Iterator[None]:
        """Time the body of a `with` statement under `name`."""
        self.started(name)
        start = time.perf_counter()
        try:
            yield
        finally:
            seconds = time.perf_counter() - start
            self.spans.append((name, seconds))
            self.ended(name, seconds)

    def record(self, name: str, seconds: float) -> None:
        """Note a time that was measured elsewhere, such as by a GPU."""
        self.spans.append((name, seconds))

    def seconds(self) -> dict[str, float]:
        """Total seconds per span name."""
        total: dict[str, float] = {}
        for name, seconds in self.spans:
            total[name] = total.get(name, 0.0) + seconds
        return total

    def started(self, name: str) -> None:
        """Hook: a span begins."""

    def advance(self, done: int, total: int) -> None:
        """Hook: the innermost span has done `done` of `total` units."""

    def ended(self, name: str, seconds: float) -> None:
        """Hook: a span ended."""
