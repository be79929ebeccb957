"""The tables of Milet, Kobrtek, Zemcik and Peciva as commands below `umbrae bench`."""

from typing import Annotated

import typer

from umbrae.bench import milet
from umbrae.bench.command_options import Models, Output, begin, finish, known
from umbrae.bench.milet import Effort
from umbrae.options import Json, Quiet

app = typer.Typer(rich_markup_mode=None)

Full = Annotated[
    bool, typer.Option("--full/--quick", help="All of the paper's columns at its sizes, or minutes without a GPU.")
]
FramesOf = Annotated[
    int | None, typer.Option("--frames", min=1, metavar="N", help="Along each flight; 3, or one a second in full.")
]
Most = Annotated[
    int | None,
    typer.Option("--most", min=1_000, metavar="TRIANGLES", help="Of the largest spheres; 110000, or all in full."),
]


@app.command("milet-resolution")
def resolution(
    full: Full = False,
    frames: FramesOf = None,
    folder: Models = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure silhouettes on Sponza at four resolutions: Table 1 of Milet et al."""
    clock, place = begin(folder, output, as_json or quiet)
    finish(milet.run_resolution(place, Effort(full, frames), clock), output, as_json)


@app.command("milet-textures")
def textures(
    full: Full = False,
    frames: FramesOf = None,
    folder: Models = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure whole pictures of Sponza with textures and without: Table 2 of Milet et al."""
    clock, place = begin(folder, output, as_json or quiet)
    finish(milet.run_textures(place, Effort(full, frames), clock), output, as_json)


@app.command("milet-spheres")
def spheres(
    full: Full = False,
    scene: Annotated[
        list[str], typer.Option(metavar="NAME", help=f"One of {', '.join(milet.SPHERE_SCENES)}; repeatable.")
    ] = [],  # noqa: B006
    most: Most = None,
    frames: FramesOf = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure silhouettes of spheres of more and more triangles: Tables 3 and 4 of Milet et al."""
    clock, _ = begin(None, output, as_json or quiet)
    names = known(scene, milet.SPHERE_SCENES)
    finish(milet.run_spheres(names, Effort(full, frames, most), clock), output, as_json)


@app.command("milet-objects")
def objects(
    full: Full = False,
    scene: Annotated[
        list[str], typer.Option(metavar="NAME", help=f"One of {', '.join(milet.OBJECT_SCENES)}; repeatable.")
    ] = [],  # noqa: B006
    most: Most = None,
    frames: FramesOf = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure the same triangles in more and more objects: Tables 5 and 9 of Milet et al."""
    clock, _ = begin(None, output, as_json or quiet)
    names = known(scene, milet.OBJECT_SCENES)
    finish(milet.run_objects(names, Effort(full, frames, most), clock), output, as_json)


@app.command("milet-shadow-map")
def shadow_map(
    full: Full = False,
    most: Most = None,
    frames: FramesOf = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure silhouettes and alias-free maps beside shadow maps: Table 6 of Milet et al."""
    clock, _ = begin(None, output, as_json or quiet)
    finish(milet.run_shadow_map(Effort(full, frames, most), clock), output, as_json)


@app.command("milet-invisible")
def invisible(
    full: Full = False,
    most: Most = None,
    frames: FramesOf = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure views of nothing beside views of everything: Table 7 of Milet et al."""
    clock, _ = begin(None, output, as_json or quiet)
    finish(milet.run_invisible(Effort(full, frames, most), clock), output, as_json)


@app.command("milet-overall")
def overall(
    full: Full = False,
    most: Most = None,
    frames: FramesOf = None,
    folder: Models = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure all methods on spheres and Sponza: Table 8 of Milet et al."""
    clock, place = begin(folder, output, as_json or quiet)
    finish(milet.run_overall(place, Effort(full, frames, most), clock), output, as_json)
