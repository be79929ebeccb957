"""What is printed: notes, one JSON object, and progress: a line per stage, and a bar when one takes long."""

import json
import sys
from threading import RLock, Timer
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn

from umbrae.clock import Clock

BAR_AFTER_SECONDS = 1.0


def note(text: str) -> None:
    """One line on stderr that is good to know."""
    print(f"umbrae: note: {one_line(text)}", file=sys.stderr)


def print_json(**values: Any) -> None:
    """One JSON object on stdout."""
    print(json.dumps(values))


def one_line(text: str) -> str:
    """Without line breaks and double spaces."""
    return " ".join(text.split())


class ConsoleClock(Clock):
    """A clock that prints every finished outermost span with its time on stderr.

    A span that lasts longer than a second shows a bar: how far the innermost span has come where it says
    so, a pulse where it does not. The bar needs a terminal; elsewhere there are only the lines, without
    control codes.
    """

    def __init__(self, console: Console | None = None) -> None:
        super().__init__()
        self._console = console or Console(stderr=True, highlight=False)
        self._names: list[str] = []
        self._timer: Timer | None = None
        self._bar: Progress | None = None
        self._task = TaskID(0)
        self._lock = RLock()

    def started(self, name: str) -> None:
        """Start waiting for the bar's moment with the outermost span; tell the bar of inner ones."""
        with self._lock:
            self._names.append(name)
            if len(self._names) == 1 and self._console.is_terminal:
                self._timer = Timer(BAR_AFTER_SECONDS, self._show)
                self._timer.daemon = True
                self._timer.start()
            self._pulse()

    def advance(self, done: int, total: int) -> None:
        """Move the bar, if it is there."""
        with self._lock:
            if self._bar is not None:
                self._bar.update(self._task, completed=done, total=total)

    def ended(self, name: str, seconds: float) -> None:
        """Print the line of an outermost span, unless an exception ended it."""
        with self._lock:
            self._names.pop()
            if self._names:
                self._pulse()
                return
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            if self._bar is not None:
                self._bar.stop()
                self._bar = None
        if sys.exc_info()[0] is None:
            self._console.print(f"{name:<20}{seconds:8.2f} s", markup=False, soft_wrap=True)

    def _show(self) -> None:
        with self._lock:
            if self._timer is None or self._bar is not None:
                return
            columns = (
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                TaskProgressColumn(),
                TimeElapsedColumn(),
            )
            self._bar = Progress(*columns, console=self._console, transient=True)
            self._task = self._bar.add_task("", total=None)
            self._pulse()
            self._bar.start()

    def _pulse(self) -> None:
        """A new task for the innermost span, its total not known yet."""
        if self._bar is not None:
            self._bar.remove_task(self._task)
            self._task = self._bar.add_task(" · ".join(self._names), total=None)
