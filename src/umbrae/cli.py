"""The command line: arguments in, the library called, results out.

Results (paths, tables, one JSON object with `--json`) go to stdout; stages, progress, notes, errors to
stderr. Exit status: 0 done; 1 `verify` or `bench` found a wrong sample; 2 bad input or too little memory; 70 a bug in
Umbrae; 130 interrupted; 143 terminated.
"""

import dataclasses
import datetime as dt
import errno
import json
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.table import Table

import umbrae as um
from umbrae import arguments, files, info, models, outputs
from umbrae import sun as sunlight
from umbrae.arguments import Side, Size
from umbrae.bench import commands as bench
from umbrae.clock import Clock
from umbrae.console import ConsoleClock, note, one_line
from umbrae.errors import OptionError, RecentredWarning, UmbraeError
from umbrae.methods import make_method
from umbrae.options import (
    DEFAULT_GRID,
    DEFAULT_SIZE,
    DEFAULT_STEP,
    DEFAULT_UP,
    Eye,
    Fov,
    Json,
    MethodName,
    Model,
    Output,
    Points,
    Quiet,
    SizeOption,
    Suns,
    Target,
    Up,
)
from umbrae.shade import mask_image
from umbrae.warmup import compile_kernels

app = typer.Typer(
    help="Exact shadows of arbitrary triangle soups.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
scenes = typer.Typer(rich_markup_mode=None)
app.add_typer(scenes, name="scene", help="Write one of the scenes that Umbrae makes itself.")
app.add_typer(bench.app, name="bench", help="Measure Umbrae beside Embree.")


@app.callback(invoke_without_command=True)
def umbrae(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    """Exact shadows of arbitrary triangle soups."""
    if version:
        print(f"umbrae {um.__version__}")
        raise typer.Exit


@app.command()
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
    method: MethodName = "frustum",
    mask: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Shadow mask: white lit, black dark; several lights: MASK_1, MASK_2, ..."),
    ] = None,
    npz: Annotated[Path | None, typer.Option(metavar="FILE", help="Samples and masks as numpy arrays.")] = None,
    samples_per_pixel: Annotated[int, typer.Option(min=1, metavar="N", help="For smooth edges.")] = 1,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Render MODEL with exact shadows."""
    clock = _clock(as_json or quiet)
    algorithm = make_method(method)
    picture = output or Path(f"{model.stem}.png")
    mask_paths = outputs.mask_paths(mask, max(1, len(light) + len(sun)))
    outputs.check(model, [picture, *mask_paths], npz)
    written = [picture, *mask_paths, *([npz] if npz else [])]

    scene = _load(model, clock, written)
    camera = arguments.camera(scene, size, eye, target, up, fov)
    lights = arguments.lights(scene, camera, light, sun, up)
    compile_kernels([algorithm], samples_per_pixel, clock)
    image = um.render(scene, camera, lights, method=algorithm, samples_per_pixel=samples_per_pixel, up=up, clock=clock)
    samples = image.samples
    assert samples is not None
    _note_if_nothing_is_seen(samples)
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
    _print_json(
        model=str(model),
        triangles=len(scene.triangles),
        size=list(size),
        samples=samples.size,
        covered=int(samples.covered.sum()),
        method=algorithm.name,
        options=algorithm.options(),
        guarantee=algorithm.guarantee,
        origin=scene.origin.tolist(),
        lights=[
            {
                "position": one.position.tolist(),
                "in_shadow": int(shadow_mask.in_shadow.sum()),
                "stats": {name: int(value) for name, value in shadow_mask.stats.items()},
            }
            for one, shadow_mask in zip(lights, image.masks, strict=True)
        ],
        seconds=clock.seconds(),
        picture=str(picture),
        masks=[str(path) for path in mask_paths],
        npz=str(npz) if npz else None,
    )


@app.command("info")
def info_command(model: Model, as_json: Json = False) -> None:
    """Say what MODEL consists of."""
    clock = _clock(as_json)
    scene = _load(model, clock)
    with clock.span("count"):
        facts = info.describe(scene)
    if as_json:
        _print_json(model=str(model), **facts.as_dict())
    else:
        Console(highlight=False).print(info.table(facts))


@app.command()
def verify(
    model: Model,
    method: MethodName = "frustum",
    count: Annotated[int, typer.Option(min=1, metavar="N", help="Samples to check.")] = 20_000,
    size: SizeOption = DEFAULT_SIZE,
    eye: Eye = None,
    target: Target = None,
    up: Up = DEFAULT_UP,
    fov: Fov = 50.0,
    light: Points = [],  # noqa: B006
    sun: Suns = [],  # noqa: B006
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Of the random choice of samples.")] = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare random samples of a picture with the oracle; exit status 1 if one is wrong outside the band."""
    clock = _clock(as_json or quiet)
    algorithm = make_method(method)
    scene = _load(model, clock)
    camera = arguments.camera(scene, size, eye, target, up, fov)
    lights = arguments.lights(scene, camera, light, sun, up)
    compile_kernels([algorithm, make_method("oracle")], 1, clock)
    with clock.span("sample"):
        samples = um.sample(scene, camera, clock=clock)
    _note_if_nothing_is_seen(samples)
    verdicts = []
    for one in lights:
        shadow_mask = um.shadow(scene, one, samples, method=algorithm, clock=clock)
        with clock.span("verify"):
            verdicts.append(um.verify(scene, one, samples, shadow_mask, count=count, seed=seed, clock=clock))
    if as_json:
        results = [
            {
                "position": one.position.tolist(),
                "checked": verdict.checked,
                "mismatches": verdict.mismatches,
                "outside_band": verdict.outside_band,
                "inside_band": verdict.inside_band,
                "worst_margin": verdict.worst_margin,
            }
            for one, verdict in zip(lights, verdicts, strict=True)
        ]
        about = {"model": str(model), "method": algorithm.name, "seed": seed, "origin": scene.origin.tolist()}
        _print_json(**about, lights=results, seconds=clock.seconds())
    else:
        for one, verdict in zip(lights, verdicts, strict=True):
            if one.is_directional:
                where = f"sun towards {info.triple(one.position[:3], 6)}"
            else:
                digits = info.FAR_DIGITS if scene.origin.any() else 6
                where = f"light at {info.triple(one.position[:3] + scene.origin, digits)}"
            print(
                f"{where}: {verdict.checked:,} samples, {verdict.outside_band:,} wrong outside the "
                f"band, {verdict.inside_band:,} inside, worst margin {verdict.worst_margin:.3g}"
            )
    if not all(verdict.ok for verdict in verdicts):
        raise typer.Exit(1)


@app.command()
def sun(
    model: Model,
    lat: Annotated[float, typer.Option(metavar="DEGREES", help="Latitude, north of the equator.")],
    lon: Annotated[float, typer.Option(metavar="DEGREES", help="Longitude, east of Greenwich.")],
    date: Annotated[str, typer.Option(metavar="YYYY-MM-DD", help="The day, from midnight to midnight.")],
    output: Annotated[
        list[Path],
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Picture, or .npz, .csv, .ply, .glb with sensors; repeatable; MODEL's name with _sun.png here.",
        ),
    ] = [],  # noqa: B006
    step: Annotated[
        dt.timedelta, typer.Option(parser=arguments.duration, metavar="TIME", help="Between two places of the sun.")
    ] = DEFAULT_STEP,
    timezone: Annotated[
        str | None, typer.Option(metavar="NAME", help="Such as Europe/Vienna; whole hours by the longitude.")
    ] = None,
    north: Annotated[
        float, typer.Option(metavar="DEGREES", help="Where north is, clockwise from -z (+y when z is up).")
    ] = 0.0,
    up: Up = DEFAULT_UP,
    grid: Annotated[
        float | None, typer.Option(metavar="SPACING", help="Sensors on a grid over the faces; one in each face.")
    ] = None,
    side: Annotated[Side, typer.Option(help="Of the faces, where sensors are.")] = Side.SUNNIER,
    size: SizeOption = DEFAULT_SIZE,
    eye: Eye = None,
    target: Target = None,
    fov: Fov = 50.0,
    samples_per_pixel: Annotated[int, typer.Option(metavar="N", help="For smooth edges: 1, 4, 9, ...")] = 4,
    method: MethodName = "frustum",
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Count the hours of direct sun on MODEL over a day."""
    clock = _clock(as_json or quiet)
    algorithm = make_method(method)
    paths = output or [Path(f"{model.stem}_sun.png")]
    outputs.check_paths(model, [(path, (*files.IMAGES, *sunlight.STUDIES)) for path in paths])
    pictures = [path for path in paths if path.suffix.lower() in files.IMAGES]
    studies = [path for path in paths if path not in pictures]
    if grid is not None and not studies:
        raise OptionError(f"--grid is for sensors: wanted an output of {' '.join(sunlight.STUDIES)}")
    zone = sunlight.longitude_zone(lon) if timezone is None else timezone
    times = sunlight.day_times(date, step, zone)
    # A single step is as long as the day; of several, the length is the distance.
    sky = sunlight.Sky.over(times, lat, lon, north=north, up=up, step=step if len(times) == 1 else None)
    view = Size(size.width, size.height - sunlight.legend_height(size.width))
    if pictures and view.height < 1:
        raise OptionError(
            f"--size: wanted more than {size.height - view.height} pixels of height, which the legend takes"
        )

    scene = _load(model, clock, paths)
    if not (as_json or quiet):
        note(f"{date}, times in {zone}: the sun is above the horizon for {sky.possible_hours:.1f} hours")
    camera = arguments.camera(scene, view, eye, target, up, fov) if pictures else None
    if camera is not None:
        sunlight.finer_camera(camera, samples_per_pixel)
    compile_kernels([algorithm], 1, clock)
    facts: dict[str, Any] = {}
    if studies:
        with clock.span("sensors"):
            sensors = sunlight.surface_sensors(scene, grid, -1 if side is Side.BACK else 1)
        if side is Side.SUNNIER:
            both = sunlight.both_sides(sensors)
            sensors, study = sunlight.sunnier(both, sunlight.sun_study(scene, both, sky, algorithm, clock))
        else:
            study = sunlight.sun_study(scene, sensors, sky, algorithm, clock)
        facts = {"sensors": sensors.size, **sunlight.summary(scene, sensors, study)}
        with clock.span("write"):
            for path in studies:
                sunlight.save_study(path, scene, sensors, study)
    if camera is not None:
        image = sunlight.sun_map(scene, camera, sky, samples_per_pixel, algorithm, clock)[0]
        assert image.samples is not None
        _note_if_nothing_is_seen(image.samples)
        with clock.span("write"):
            for path in pictures:
                image.save(path)

    if not sky.is_day.any():
        note("the sun does not rise on that day: 0 hours everywhere")
    if not as_json:
        for path in paths:
            print(path)
        return
    _print_json(
        model=str(model),
        triangles=len(scene.triangles),
        date=str(sky.times[0].date()),
        timezone=str(zone),
        step_minutes=sky.step_hours * 60,
        positions=len(sky.times),
        above_horizon=int(sky.is_day.sum()),
        possible_hours=sky.possible_hours,
        method=algorithm.name,
        guarantee=algorithm.guarantee,
        **facts,
        seconds=clock.seconds(),
        outputs=[str(path) for path in paths],
    )


@app.command()
def methods() -> None:
    """List the shadow algorithms."""
    rows = Table("name", "paper", "guarantee", "options", box=None, pad_edge=False)
    for name, method in um.METHODS.items():
        options = ", ".join(f"{field.name}={field.default}" for field in dataclasses.fields(method)) or "none"
        rows.add_row(name, method.paper, method.guarantee, options)
    Console(highlight=False).print(rows)


@scenes.command("spheres")
def write_spheres(
    output: Output = Path("spheres.glb"),
    grid: Annotated[Size, typer.Option(parser=arguments.size, metavar="AxB", help="Number of spheres.")] = DEFAULT_GRID,
    triangles: Annotated[int, typer.Option(metavar="N", help="In all, about.")] = 100_000,
    quiet: Quiet = False,
) -> None:
    """Spheres over a ground plane, after Milet et al."""
    _write_scene(output, lambda: models.spheres((grid.width, grid.height), triangles), quiet)


@scenes.command("pavilion")
def write_pavilion(output: Output = Path("pavilion.glb"), quiet: Quiet = False) -> None:
    """A small piece of architecture with a tree and coloured glass."""
    _write_scene(output, models.pavilion, quiet)


def main() -> NoReturn:
    """Entry point of the `umbrae` command."""
    signal.signal(signal.SIGTERM, _terminate)
    status = run(sys.argv[1:])
    if status in (130, 143):
        # Without waiting for a kernel that is being compiled in another thread.
        os._exit(status)
    sys.exit(status)


def run(texts: Sequence[str]) -> int:
    """Carry out one command line; returns the exit status, whatever happens."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("always", UserWarning)
            warnings.showwarning = _show_warning
            status = app(list(texts) or ["--help"], standalone_mode=False, prog_name="umbrae")
        if sys.stdout is not None:
            sys.stdout.flush()
    except UmbraeError as error:
        return _fail(str(error), 2)
    except typer.TyperException as error:
        return _fail(error.format_message(), 2)
    except (KeyboardInterrupt, typer.Abort):
        status = 130
    except _Terminated:
        return _fail("terminated", 143)
    except SystemExit:
        # What typer makes of a reader of stdout that has gone, such as `head`.
        return 1
    except MemoryError as error:
        return _fail(f"out of memory: {str(error) or 'a smaller --size needs less'}", 2)
    except Exception as error:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EIO, errno.EBADF):
            # Files have errors of their own: this is stdout, which must not be tried again on the way out.
            sys.stdout = None
            return _fail(f"cannot print the results: {error.strerror}", 2)
        if os.environ.get("UMBRAE_DEBUG"):
            raise
        return _fail(f"{type(error).__name__}: {error} (a bug; UMBRAE_DEBUG=1 shows the traceback)", 70)
    # typer returns 130, too.
    return _fail("interrupted", 130) if status == 130 else int(status or 0)


class _Terminated(BaseException):
    """SIGTERM, as an exception: half-written files are removed on its way out."""


def _terminate(*_: Any) -> NoReturn:
    raise _Terminated


def _clock(silent: bool) -> Clock:
    return Clock() if silent else ConsoleClock()


def _write_scene(output: Path, make: Callable[[], um.Scene], quiet: bool) -> None:
    files.check_writable(output, files.MODELS)
    clock = _clock(quiet)
    with clock.span("make"):
        scene = make()
    with clock.span("write"):
        um.save(scene, output)
    print(output)


def _load(model: Path, clock: Clock, written: Sequence[Path] = ()) -> um.Scene:
    scene = um.load(model, clock, written)
    used = {scene.materials[index] for index in set(scene.material_id.tolist())}
    soft = sum(not material.casts_solid for material in used)
    if soft:
        note(f"{soft} alpha-masked or transparent material{'s' * (soft > 1)}: casting solid shadows for now")
    return scene


def _note_if_nothing_is_seen(samples: um.ViewSamples) -> None:
    if not samples.covered.any():
        note("the camera sees nothing of the model")


def _show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    if issubclass(category, RecentredWarning):
        message = "coordinates far from zero: recentred inside; options stay in the file's own coordinates"
    note(str(message))


def _fail(text: str, status: int) -> int:
    print(f"umbrae: error: {one_line(text)}", file=sys.stderr)
    return status


def _print_json(**values: Any) -> None:
    print(json.dumps(values))
