"""`umbrae info`, `umbrae methods` and `umbrae doctor`: what a model is, what Umbrae can do, what works here."""

import dataclasses

import typer
from rich.console import Console
from rich.table import Table

from umbrae import doctor, info
from umbrae.clock import Clock
from umbrae.commands.model import load
from umbrae.console import ConsoleClock, print_json
from umbrae.methods import METHODS
from umbrae.options import Json, Model, Quiet

WIDE = 96
"""Columns of a terminal from which the table of methods has room for whole options."""


def info_command(model: Model, as_json: Json = False) -> None:
    """Say what MODEL consists of."""
    clock = Clock() if as_json else ConsoleClock()
    scene = load(model, clock)
    with clock.span("count"):
        facts = info.describe(scene)
    if as_json:
        print_json(model=str(model), **facts.as_dict())
    else:
        Console(highlight=False).print(info.table(facts))


def methods() -> None:
    """List the shadow algorithms."""
    console = Console(highlight=False)
    rows = Table(box=None, pad_edge=False, collapse_padding=True)
    rows.add_column("name", no_wrap=True)
    rows.add_column("paper", overflow="fold")
    for name in ("engine", "guarantee", "takes"):
        rows.add_column(name, no_wrap=True)
    rows.add_column("options", overflow="fold", no_wrap=console.width >= WIDE)
    for name, method in METHODS.items():
        options = "\n".join(f"{field.name}={field.default}" for field in dataclasses.fields(method)) or "none"
        rows.add_row(name, method.paper, method.engine, method.guarantee, "\n".join(method.accepts), options)
    console.print(rows)


def doctor_command(as_json: Json = False, quiet: Quiet = False) -> None:
    """Say what works here, and how to get what does not; exit status 1 if not even the CPU methods do."""
    report = doctor.examine(Clock() if as_json or quiet else ConsoleClock())
    if as_json:
        print_json(**report.as_dict())
    else:
        doctor.show(report, Console(highlight=False))
    if not report.works:
        raise typer.Exit(1)
