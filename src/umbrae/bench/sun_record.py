"""A benchmark of sensors and suns: its JSON file, and its table on the screen."""

import dataclasses
import datetime
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from umbrae.bench import machine
from umbrae.bench.record import SCHEMA
from umbrae.files import save_text


@dataclass(frozen=True)
class SunRun:
    """What one contestant did.

    Attributes
    ----------
    not_run
        Why there is nothing else; None when it ran.
    prepare_seconds, trace_seconds
        The work that depends on the geometry alone, and the shadows of each sun. None and empty where the guarantee
        is broken.
    stages
        Seconds of each span on the clock, all suns together.
    asked, differ
        Verdicts asked for, and those that differ from the exact ones.
    checked, wrong
        Verdicts compared with the oracle, and those that differ from it; of methods of Umbrae only.
    """

    name: str
    guarantee: str
    options: Mapping[str, Any] = field(default_factory=dict)
    not_run: str | None = None
    prepare_seconds: float | None = None
    trace_seconds: tuple[float, ...] = ()
    stages: Mapping[str, float] = field(default_factory=dict)
    asked: int = 0
    differ: int = 0
    checked: int = 0
    wrong: int = 0

    @property
    def broken(self) -> bool:
        """Whether a verdict differs from what was promised."""
        return self.guarantee == "exact" and self.differ + self.wrong > 0


@dataclass(frozen=True)
class SunRecord:
    """One benchmark: what was asked, on what machine, with which results; `SunRecord.of` stamps it.

    Attributes
    ----------
    scene
        Name from `SCENES`.
    triangles, sensors, suns
        How many.
    """

    scene: str
    triangles: int
    sensors: int
    suns: int
    machine: Mapping[str, Any]
    date: str
    runs: tuple[SunRun, ...] = ()

    @classmethod
    def of(cls, scene: str, triangles: int, sensors: int, suns: int) -> "SunRecord":
        """Without results yet, on this machine, now."""
        date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        return cls(scene, triangles, sensors, suns, machine.describe(), date)

    @property
    def broken(self) -> bool:
        """Whether some contestant broke its guarantee."""
        return any(run.broken for run in self.runs)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"schema": SCHEMA, "benchmark": "sun", **dataclasses.asdict(self)}

    def save(self, path: Path) -> None:
        """Write the file, whole or not at all."""
        save_text(path, json.dumps(self.as_dict(), indent=1) + "\n")

    def show(self, console: Console) -> None:
        """Print a table, no wider than the console."""
        console.print(
            f"{self.scene}: {self.triangles:,} triangles, {self.sensors:,} sensors, {self.suns} suns, "
            f"{self.sensors * self.suns:,} verdicts",
            markup=False,
        )
        rows = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        rows.add_column("", no_wrap=True)
        for name in ("prepare s", "trace s", "verdicts/s", "differ"):
            rows.add_column(name, justify="right", no_wrap=True)
        for run in self.runs:
            if run.not_run is None:
                rows.add_row(escape(run.name), *self._figures(run))
        console.print(rows)
        for run in self.runs:
            if run.not_run is not None:
                console.print(f"  {run.name} not run: {run.not_run}", markup=False)
        console.print("\n" + self._legend(), markup=False)
        for run in self.runs:
            if run.broken:
                text = (
                    f"WRONG: {run.name} promises exact verdicts, but {run.wrong:,} of {run.checked:,} differ from the "
                    f"oracle, {run.differ:,} of {run.asked:,} from {self.runs[0].name}: no time"
                )
                console.print(Text(text, style="bold red"))

    def _figures(self, run: SunRun) -> tuple[str | Text, ...]:
        share = run.differ / max(1, run.asked)
        differ = "0" if run.differ == 0 else "<0.0001%" if share < 5e-7 else f"{share:.4%}"
        if run.prepare_seconds is None:
            return Text("WRONG", style="bold red"), "-", "-", differ
        trace = sum(run.trace_seconds)
        return f"{run.prepare_seconds:.3f}", f"{trace:,.3f}", f"{self.sensors * self.suns / trace:,.0f}", differ

    def _legend(self) -> str:
        exact = self.runs[0]
        facing = next((run.asked for run in self.runs if run.guarantee != "exact" and run.not_run is None), None)
        text = (
            f"verdicts/s: all sensors and suns, over the time to trace. differ: share of a contestant's verdicts that "
            f"are not those of {exact.name}, of which {exact.checked:,} were held against the oracle."
        )
        if facing is None:
            return text
        share = facing / (self.sensors * self.suns)
        return (
            f"{text} Ray casters are asked only about sensors that face the sun ({share:.0%} of the verdicts); the "
            "others count as decided."
        )
