"""`umbrae scene`: the scenes that Umbrae makes itself, as files."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

import umbrae as um
from umbrae import arguments, files, models
from umbrae.arguments import Size
from umbrae.clock import Clock
from umbrae.console import ConsoleClock
from umbrae.options import DEFAULT_GRID, DEFAULT_LOTS, Output, Quiet

app = typer.Typer(rich_markup_mode=None)
"""The commands below `umbrae scene`."""


@app.command()
def spheres(
    output: Output = Path("spheres.glb"),
    grid: Annotated[Size, typer.Option(parser=arguments.size, metavar="AxB", help="Number of spheres.")] = DEFAULT_GRID,
    triangles: Annotated[int, typer.Option(metavar="N", help="In all, about.")] = 100_000,
    quiet: Quiet = False,
) -> None:
    """Spheres over a ground plane, after Milet et al."""
    _write(output, lambda: models.spheres((grid.width, grid.height), triangles), quiet)


@app.command()
def town(
    output: Output = Path("town.glb"),
    grid: Annotated[Size, typer.Option(parser=arguments.size, metavar="AxB", help="Number of lots.")] = DEFAULT_LOTS,
    triangles: Annotated[int, typer.Option(metavar="N", help="In all, about.")] = 200_000,
    tree: Annotated[int, typer.Option(metavar="N", help="Of these, in a tree in a street; none.")] = 0,
    quiet: Quiet = False,
) -> None:
    """A town of houses with balconies along straight streets, each an object of its own."""
    _write(output, lambda: models.town((grid.width, grid.height), triangles, tree), quiet)


@app.command()
def pavilion(output: Output = Path("pavilion.glb"), quiet: Quiet = False) -> None:
    """A small piece of architecture with a tree and coloured glass."""
    _write(output, models.pavilion, quiet)


def _write(output: Path, make: Callable[[], um.Scene], quiet: bool) -> None:
    files.check_writable(output, files.MODELS)
    clock = Clock() if quiet else ConsoleClock()
    with clock.span("make"):
        scene = make()
    with clock.span("write"):
        um.save(scene, output)
    print(output)
