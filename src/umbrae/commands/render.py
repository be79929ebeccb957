"""`umbrae render`: a picture with exact shadows, masks, arrays; or a figure of the shadow volumes."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer

import umbrae as um
from umbrae import arguments, files, outputs
from umbrae.arguments import Size
from umbrae.clock import Clock
from umbrae.commands.figure import Show, check, figure, kind_of, picture_height
from umbrae.commands.film import Frames, Shot, film_of, frames_of
from umbrae.commands.model import load, note_if_nothing_is_seen, note_if_nothing_is_smooth
from umbrae.console import ConsoleClock, note, print_json
from umbrae.errors import OptionError
from umbrae.methods import make_method
from umbrae.methods.smooth.silhouette import SmoothMethod
from umbrae.options import (
    DEFAULT_SIZE,
    DEFAULT_UP,
    Counter,
    Counting,
    Culling,
    Determinism,
    Epsilon,
    EpsilonPx,
    Eye,
    Fov,
    Json,
    LightRadius,
    LightSamples,
    MapBias,
    MapFilter,
    MapProjection,
    MapSize,
    MapSlopeBias,
    MethodName,
    Model,
    Opaque,
    Points,
    Quiet,
    Silhouette,
    SizeOption,
    SmoothNormals,
    SunDiameter,
    Suns,
    Target,
    Up,
    given,
    of_shadow_map,
)
from umbrae.render import is_filtered
from umbrae.shade import mask_image
from umbrae.transmission import transmission_of
from umbrae.warmup import compile_kernels

FRAME = ("sample", "shadow", "shade")
"""The stages that each picture takes anew, whatever was prepared before."""


def render(
    model: Model,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Picture; MODEL's name with .png here."),
    ] = None,
    size: SizeOption = DEFAULT_SIZE,
    eye: Eye = None,
    target: Target = None,
    up: Up = DEFAULT_UP,
    fov: Fov = 50.0,
    light: Points = [],  # noqa: B006
    sun: Suns = [],  # noqa: B006
    light_radius: LightRadius = 0.0,
    sun_diameter: SunDiameter = 0.0,
    light_samples: LightSamples = None,
    method: MethodName = "frustum",
    counting: Counting = None,
    determinism: Determinism = None,
    counter: Counter = None,
    culling: Culling = None,
    map_size: MapSize = None,
    map_bias: MapBias = None,
    map_slope_bias: MapSlopeBias = None,
    map_filter: MapFilter = None,
    map_projection: MapProjection = None,
    silhouette: Silhouette = None,
    epsilon: Epsilon = None,
    epsilon_px: EpsilonPx = None,
    show: Annotated[
        Show | None,
        typer.Option(
            parser=kind_of,
            metavar="count|volumes",
            help="A figure instead: how many shadow volumes hold each sample, or the volumes.",
        ),
    ] = None,
    mask: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Shadow mask: white lit, black dark; several lights: MASK_1, MASK_2, ..."),
    ] = None,
    npz: Annotated[Path | None, typer.Option(metavar="FILE", help="Samples and masks as numpy arrays.")] = None,
    samples_per_pixel: Annotated[int, typer.Option(min=1, metavar="N", help="For smooth edges.")] = 1,
    layers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Surfaces to see through at most, one behind another; 8.")
    ] = None,
    stochastic: Annotated[
        bool, typer.Option("--stochastic", help="See through surfaces by chance, with several samples per pixel.")
    ] = False,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="Chooses the chances of --stochastic.")] = None,
    antialiasing: Annotated[
        str,
        typer.Option(
            metavar="samples|derivative",
            help="Smooth edges by samples per pixel, or those of shadows alone by filtering each pixel's footprint.",
        ),
    ] = "samples",
    filter_width: Annotated[
        float | None,
        typer.Option(metavar="PIXELS", help="Of the footprint of --antialiasing derivative; 1, more blurs."),
    ] = None,
    smooth_outlines: Annotated[
        int, typer.Option(min=1, metavar="LEVEL", help="Cut curved sides into so many pieces, for what is seen alone.")
    ] = 1,
    smooth_normals: SmoothNormals = None,
    frames: Annotated[
        Frames | None,
        typer.Option(
            parser=frames_of,
            metavar="A:B[:STEP]",
            help="Frames of an animation, from A and before B, as frame_%04d.png or clip.mp4 (-o).",
        ),
    ] = None,
    fps: Annotated[float | None, typer.Option(metavar="N", help="Frames per second; 30.")] = None,
    animation: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which of the model's animations; the first one.")
    ] = None,
    orbit: Annotated[
        float | None, typer.Option(metavar="DEGREES", help="That the camera goes around the model per second.")
    ] = None,
    opaque: Opaque = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Render MODEL with exact shadows."""
    clock = Clock() if as_json or quiet else ConsoleClock()
    options = given(
        counting=counting, determinism=determinism, counter=counter, culling=culling, light_samples=light_samples,
        silhouette=silhouette, epsilon=epsilon, epsilon_px=epsilon_px,
    )  # fmt: skip
    options |= of_shadow_map(
        method, size=map_size, bias=map_bias, slope_bias=map_slope_bias, filter=map_filter, projection=map_projection
    )
    algorithm = make_method(method, **options)
    filtered, sized = is_filtered(antialiasing, samples_per_pixel, algorithm), light_radius > 0 or sun_diameter > 0
    if filter_width is not None and not filtered:
        raise OptionError("--filter-width is that of --antialiasing derivative, which is not there")
    if filter_width is not None and not 0.0 < filter_width < math.inf:
        raise OptionError(f"--filter-width: wanted a number of pixels > 0, got {filter_width}")
    arguments.check_light_samples(light_samples, light_radius, sun_diameter)
    if layers is not None and stochastic:
        raise OptionError("--layers: --stochastic sees through all surfaces, with no layers")
    if layers is not None and smooth_outlines > 1:
        raise OptionError("--layers: --smooth-outlines sees solid surfaces only")
    chances = _chances(stochastic, seed, samples_per_pixel, show)
    if chances is not None and "transparency" in algorithm.options():
        algorithm = make_method(algorithm, transparency="stochastic", seed=chances)
    view = size
    if show is not None:
        if antialiasing != "samples":
            raise OptionError(f"--show {show} draws a figure, which has no --antialiasing")
        if sized:
            raise OptionError(f"--show {show}: wanted a light without --light-radius and --sun-diameter")
        if smooth_outlines > 1:
            raise OptionError(f"--show {show} draws a figure, which has no --smooth-outlines")
        check(show, algorithm, len(light) + len(sun), samples_per_pixel, (mask, npz))
        view = Size(size.width, picture_height(show, *size))
    others = {"--show": show, "--mask": mask, "--npz": npz, "--smooth-normals": smooth_normals}
    film = film_of(frames, output or Path(f"{model.stem}_%04d.png"), fps, animation, orbit, others)
    picture = output or Path(f"{model.stem}.png")
    mask_paths = outputs.mask_paths(mask, max(1, len(light) + len(sun)))
    if film is None:
        outputs.check(model, [picture, *mask_paths], npz)
        written = [picture, *mask_paths, *([npz] if npz else [])]
        scene = stage = load(model, clock, written, opaque, smooth_normals)
    else:
        film.check(model, size)
        scene, clip = film.load(model, animation, clock, opaque)
        stage = film.stage(scene, clip, up)
    note_if_nothing_is_smooth(scene, isinstance(algorithm, SmoothMethod) or smooth_outlines > 1)
    camera = arguments.camera(stage, view, eye, target, up, fov)
    lights = arguments.lights(scene, camera, light, sun, up, light_radius, sun_diameter)
    soft = any(one.is_area for one in lights)
    sheer = transmission_of(scene) is not None
    compile_kernels([algorithm], samples_per_pixel, clock, sheer, chances, soft, smooth_outlines)
    look: dict[str, Any] = {
        "samples_per_pixel": samples_per_pixel,
        "up": up,
        "layers": layers or 8,
        "stochastic": chances,
        "antialiasing": antialiasing,
        "filter_width": filter_width or 1.0,
        "smooth_outlines": smooth_outlines,
    }
    if film is not None:
        film.shoot(model, scene, clip, Shot(stage, camera, lights, algorithm, look), clock, as_json)
        return
    if show is not None:
        image = figure(show, scene, camera, lights[0], algorithm, samples_per_pixel, up, clock)
    else:
        image = um.render(scene, camera, lights, algorithm, clock=clock, **look)
    samples = image.samples
    assert samples is not None
    note_if_nothing_is_seen(samples)
    if 1 < (layers or 8) == len(image.layers):
        note(f"as many layers as there may be, {len(image.layers)}: --layers sees through more surfaces")
    with clock.span("write"):
        image.save(picture)
        for path, one in zip(mask_paths, image.masks, strict=bool(mask_paths)):
            files.save_image(path, mask_image(one))
        if npz:
            files.save_arrays(npz, **outputs.arrays(scene, lights, image))

    if not as_json:
        for path in written:
            print(path)
        return
    seconds = clock.seconds()
    print_json(
        model=str(model),
        triangles=len(scene.triangles),
        size=list(size),
        samples=samples.size,
        covered=int(samples.covered.sum()),
        layers=len(image.layers),
        stochastic=chances,
        antialiasing=antialiasing,
        smooth_outlines=smooth_outlines,
        opaque=opaque,
        smooth_normals=smooth_normals,
        method=algorithm.name,
        options=algorithm.options(),
        guarantee=image.masks[0].guarantee,
        origin=scene.origin.tolist(),
        lights=[
            {
                "position": one.position.tolist(),
                "radius": one.radius,
                "angular_diameter": one.angular_diameter,
                "in_shadow": int(shadow_mask.in_shadow.sum()),
                "stats": {name: int(value) for name, value in shadow_mask.stats.items()},
            }
            for one, shadow_mask in zip(lights, image.masks, strict=True)
        ],
        seconds={**seconds, "frame": sum(seconds[name] for name in FRAME)},
        picture=str(picture),
        show=show,
        masks=[str(path) for path in mask_paths],
        npz=str(npz) if npz else None,
    )


def _chances(stochastic: bool, seed: int | None, samples_per_pixel: int, show: Show | None) -> int | None:
    """The seed of a picture that is made by chance; None for others."""
    if not stochastic:
        if seed is not None:
            raise OptionError("--seed chooses the chances of --stochastic, which is not there")
        return None
    if show is not None:
        raise OptionError(f"--show {show} draws a figure, which has no --stochastic")
    if samples_per_pixel == 1:
        raise OptionError("--stochastic: wanted --samples-per-pixel above 1, which average out the chances")
    return seed or 0
