"""The tables of Sintorn, Olsson and Assarsson 2011 as commands below `umbrae bench`."""

from typing import Annotated

import typer

from umbrae.bench import sintorn_flythrough, sintorn_layers, sintorn_memory, sintorn_variants
from umbrae.bench.command_options import Models, Output, begin, finish, known
from umbrae.options import Json, Quiet

app = typer.Typer(rich_markup_mode=None)


@app.command("sintorn-flythrough")
def flythrough(
    full: Annotated[bool, typer.Option("--full/--quick", help="OpenGL at 4096x4096 too, or only the CPU.")] = False,
    scene: Annotated[
        list[str], typer.Option(metavar="NAME", help=f"One of {', '.join(sintorn_flythrough.FLIGHTS)}; repeatable.")
    ] = [],  # noqa: B006
    frames: Annotated[int, typer.Option(min=1, metavar="N", help="Along each flight.")] = 5,
    folder: Models = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure times and test-and-set operations along flights: Figure 7 of Sintorn et al. 2011."""
    clock, place = begin(folder, output, as_json or quiet)
    names = known(scene, sintorn_flythrough.FLIGHTS)
    sizes = sintorn_flythrough.SIZES
    opengl = sizes if full else sizes[:1]
    finish(sintorn_flythrough.run_flythrough(place, names, sizes, opengl, frames, clock), output, as_json)


@app.command("sintorn-variants")
def variants(
    full: Annotated[bool, typer.Option("--full/--quick", help="On OpenGL too, or only on the CPU.")] = False,
    scene: Annotated[
        list[str], typer.Option(metavar="NAME", help=f"One of {', '.join(sintorn_variants.SCENES)}; repeatable.")
    ] = [],  # noqa: B006
    frames: Annotated[int, typer.Option(min=1, metavar="N", help="Timed frames of each.")] = 7,
    folder: Models = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure opaque, cut out, translucent and coloured leaves: Figure 8 of Sintorn et al. 2011."""
    clock, place = begin(folder, output, as_json or quiet)
    names = known(scene, sintorn_variants.SCENES)
    size = sintorn_variants.SIZE
    finish(sintorn_variants.run_variants(place, names, full, frames, size, clock), output, as_json)


@app.command("sintorn-layers")
def layers(
    full: Annotated[bool, typer.Option("--full/--quick", help="On OpenGL too, or only on the CPU.")] = False,
    most: Annotated[
        int, typer.Option("--layers", min=1, max=32, metavar="N", help="How many.")
    ] = sintorn_layers.LAYERS,
    frames: Annotated[int, typer.Option(min=1, metavar="N", help="Timed frames of each.")] = 7,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure shadows on glass behind glass, layer by layer: Figure 1c of Sintorn et al. 2011."""
    clock, _ = begin(None, output, as_json or quiet)
    finish(sintorn_layers.run_layers(most, full, frames, sintorn_layers.SIZE, clock), output, as_json)


@app.command("sintorn-memory")
def memory(
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Tell the bytes of each buffer beside those of Sintorn et al. 2011, section 4."""
    clock, _ = begin(None, output, as_json or quiet)
    finish(sintorn_memory.run_memory(sintorn_memory.SIZES, clock), output, as_json)
