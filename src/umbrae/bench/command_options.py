"""Options and reports that the commands below `umbrae bench` share."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer
from rich.console import Console

from umbrae import files
from umbrae.bench.scenes import default_folder
from umbrae.bench.sweep import SweepRecord
from umbrae.clock import Clock
from umbrae.console import ConsoleClock
from umbrae.errors import OptionError

Models = Annotated[
    Path | None,
    typer.Option("--models", envvar="UMBRAE_MODELS", metavar="DIR", help="Where the models of the scenes lie."),
]
Output = Annotated[Path | None, typer.Option("-o", "--output", metavar="FILE", help="JSON file to write.")]


class Reported(Protocol):
    """A benchmark's record."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""

    def save(self, path: Path) -> None:
        """Write the file."""

    def show(self, console: Console) -> None:
        """Print it."""


def models_folder(folder: Path | None) -> Path | None:
    """The folder of `--models`, which must be one, or the default."""
    if folder is not None and not folder.is_dir():
        raise OptionError(f"--models: {folder} is not a folder")
    return folder or default_folder()


def report(record: Reported, output: Path | None, as_json: bool) -> None:
    """Write the file, if one is wanted, and print the record as JSON or as a table."""
    if output is not None:
        record.save(output)
    if as_json:
        print(json.dumps(record.as_dict()))
    else:
        record.show(Console(highlight=False))


def begin(folder: Path | None, output: Path | None, silent: bool) -> tuple[Clock, Path | None]:
    """A clock and the folder of models; refuses an output that cannot be written."""
    if output is not None:
        files.check_writable(output, (".json",))
    return Clock() if silent else ConsoleClock(), models_folder(folder)


def known(names: list[str], scenes: Mapping[str, object]) -> list[str]:
    """The scenes named, each once, or all of them."""
    for name in names:
        if name not in scenes:
            raise OptionError(f"unknown scene {name!r} (known: {', '.join(scenes)})")
    return list(dict.fromkeys(names)) or list(scenes)


def finish(record: SweepRecord, output: Path | None, as_json: bool) -> None:
    """Report a table; exit status 1 if a guarantee is broken."""
    report(record, output, as_json)
    if record.broken:
        raise typer.Exit(1)
