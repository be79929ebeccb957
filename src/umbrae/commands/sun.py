"""`umbrae sun`: hours of direct sun, as a picture and on sensors."""

import datetime as dt
from pathlib import Path
from typing import Annotated, Any

import typer

from umbrae import arguments, files, outputs
from umbrae import sun as sunlight
from umbrae.arguments import Side, Size
from umbrae.clock import Clock
from umbrae.commands.model import load, note_if_nothing_is_seen
from umbrae.console import ConsoleClock, note, print_json
from umbrae.errors import OptionError
from umbrae.methods import make_method
from umbrae.options import (
    DEFAULT_SIZE,
    DEFAULT_STEP,
    DEFAULT_UP,
    Eye,
    Fov,
    Json,
    MethodName,
    Model,
    Opaque,
    Quiet,
    SizeOption,
    Target,
    Up,
)
from umbrae.transmission import transmission_of
from umbrae.warmup import compile_kernels


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
    opaque: Opaque = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Count the hours of direct sun on MODEL over a day."""
    clock = Clock() if as_json or quiet else ConsoleClock()
    algorithm = make_method(method)
    paths = output or [Path(f"{model.stem}_sun.png")]
    outputs.check_paths(model, [(path, (*files.IMAGES, *sunlight.STUDIES)) for path in paths])
    pictures = [path for path in paths if path.suffix.lower() in files.IMAGES]
    studies = [path for path in paths if path not in pictures]
    if grid is not None and not studies:
        raise OptionError(f"--grid is for sensors: wanted an output of {' '.join(sunlight.STUDIES)}")
    if studies and "points" not in algorithm.accepts:
        raise OptionError(f"{algorithm.name} takes {' and '.join(algorithm.accepts)} only, and sensors are points")
    zone = sunlight.longitude_zone(lon) if timezone is None else timezone
    times = sunlight.day_times(date, step, zone)
    # A single step is as long as the day; of several, the length is the distance.
    sky = sunlight.Sky.over(times, lat, lon, north=north, up=up, step=step if len(times) == 1 else None)
    view = Size(size.width, size.height - sunlight.legend_height(size.width))
    if pictures and view.height < 1:
        raise OptionError(
            f"--size: wanted more than {size.height - view.height} pixels of height, which the legend takes"
        )

    scene = load(model, clock, paths, opaque)
    if not (as_json or quiet):
        note(f"{date}, times in {zone}: the sun is above the horizon for {sky.possible_hours:.1f} hours")
    camera = arguments.camera(scene, view, eye, target, up, fov) if pictures else None
    if camera is not None:
        sunlight.finer_camera(camera, samples_per_pixel)
    compile_kernels([algorithm], 1, clock, transmission_of(scene) is not None)
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
        note_if_nothing_is_seen(image.samples)
        with clock.span("write"):
            for path in pictures:
                image.save(path)

    if not sky.is_day.any():
        note("the sun does not rise on that day: 0 hours everywhere")
    if not as_json:
        for path in paths:
            print(path)
        return
    print_json(
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
