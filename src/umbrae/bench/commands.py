"""`umbrae bench`: arguments in, benchmarks carried out, tables and JSON out."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from umbrae import arguments, files, models
from umbrae.arguments import Size
from umbrae.bench import milet_commands, pyvista_shadows, report_commands, sintorn_commands, table
from umbrae.bench.bars import bars
from umbrae.bench.benchmark import Benchmark
from umbrae.bench.case import LIGHTS
from umbrae.bench.command_options import Models, Output, begin, finish, known, models_folder, report
from umbrae.bench.embree import EmbreexRunner, MitsubaRunner
from umbrae.bench.flythrough import FlyThrough
from umbrae.bench.mattausch import run_mattausch
from umbrae.bench.record import Record
from umbrae.bench.runner import exact_methods
from umbrae.bench.scenes import FULL, QUICK, SCENES
from umbrae.bench.stich_city import run_city
from umbrae.bench.sun import pick_sensors, run_sun
from umbrae.bench.sun_record import SunRecord
from umbrae.bench.tregenza import PATCHES, patches
from umbrae.bench.warp_rays import WarpRunner
from umbrae.camera import MAX_SIDE_PX
from umbrae.clock import Clock
from umbrae.console import ConsoleClock, note
from umbrae.errors import OptionError
from umbrae.methods import METHODS, make_method
from umbrae.options import DEFAULT_LOTS, Json, Quiet
from umbrae.warmup import compile_kernels

app = typer.Typer(rich_markup_mode=None)
"""The commands below `umbrae bench`."""
app.add_typer(sintorn_commands.app)
app.add_typer(milet_commands.app)
app.add_typer(report_commands.app)

CHECK_SCENE, CHECK_SIZE, CHECK_RUNS, CHECK_SAMPLES = "spheres-96k", (1920, 1080), 5, 5_000
"""What `umbrae bench check` measures."""
SUN_CHECKED = 20_000
"""Verdicts of `umbrae bench sun` that are compared with the oracle, for each method."""


@app.command()
def rays(
    full: Annotated[
        bool, typer.Option("--full/--quick", help="All scenes and both sizes, or about a minute of two small scenes.")
    ] = False,
    scene: Annotated[list[str], typer.Option(metavar="NAME", help=f"One of {', '.join(SCENES)}; repeatable.")] = [],  # noqa: B006
    resolution: Annotated[
        str | None, typer.Option(metavar="WxH,WxH", help="Pixels; 1920x1080, and 3840x2160 in full.")
    ] = None,
    light: Annotated[str, typer.Option(metavar="point|directional|both", help="Kind of light.")] = "both",
    runs: Annotated[int | None, typer.Option(min=1, metavar="N", help="Timed runs; 5, or 11 in full.")] = None,
    check: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Samples held against the oracle; 20000, or 100000 in full.")
    ] = None,
    path: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Key frames (CSV) to fly along, one frame a run.")
    ] = None,
    folder: Models = None,
    output: Output = None,
    resume: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Go on with an interrupted run, given the same options.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure exact shadows beside rays by Embree; exit status 1 if a guarantee is broken."""
    if output is not None and resume is not None:
        raise OptionError("--resume goes on writing its own file: leave --output out")
    benchmark = Benchmark(
        scenes=_scenes(scene, full),
        lights=_lights(light),
        sizes=_sizes(resolution or ("1920x1080,3840x2160" if full else "1920x1080")),
        runs=runs or (11 if full else 5),
        checked=check or (100_000 if full else 20_000),
        runners=[*exact_methods(), MitsubaRunner(), EmbreexRunner(), WarpRunner()],
        models=models_folder(folder),
        path=FlyThrough.load(path) if path is not None else None,
    )
    if benchmark.path is not None and len(benchmark.scenes) != 1:
        raise OptionError("--path belongs to one scene: choose it with --scene")
    record = _carry_out(benchmark, output, resume, Clock() if as_json or quiet else ConsoleClock())
    if as_json:
        print(json.dumps(record.as_dict()))
    else:
        table.show(record, Console(highlight=False))
    if record.broken:
        raise typer.Exit(1)


@app.command()
def sun(
    scene: Annotated[str, typer.Option(metavar="NAME", help=f"One of {', '.join(SCENES)}.")] = "city",
    sensors: Annotated[int, typer.Option(min=1, metavar="N", help="Picked from a grid over the faces.")] = 500_000,
    suns: Annotated[
        int, typer.Option(min=1, max=PATCHES, metavar="N", help="Centres of Tregenza's sky patches.")
    ] = PATCHES,
    folder: Models = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure many sensors under many suns beside rays by Embree; exit status 1 if a guarantee is broken."""
    clock = Clock() if as_json or quiet else ConsoleClock()
    (name,) = _scenes([scene], False)
    place = models_folder(folder)
    if output is not None:
        files.check_writable(output, (".json",))
    runners = [*exact_methods(), MitsubaRunner(), EmbreexRunner(), WarpRunner()]
    with clock.span(f"load {name}"):
        loaded = SCENES[name].load(place)
    with clock.span("sensors"):
        picked = pick_sensors(loaded, sensors)
    compile_kernels([METHODS[runner.name]() for runner in runners if runner.name in METHODS], 1, clock)
    with clock.span("warm up"):
        tiny = models.spheres((2, 2), 100)
        run_sun(tiny, pick_sensors(tiny, 200), patches(1), runners, 1, Clock())
    record = SunRecord.of(name, len(loaded.triangles), picked.size, suns)
    record = replace(record, runs=run_sun(loaded, picked, patches(suns), runners, SUN_CHECKED, clock))
    report(record, output, as_json)
    if record.broken:
        raise typer.Exit(1)


@app.command()
def mattausch(
    frames: Annotated[int, typer.Option(min=1, metavar="N", help="Timed frames of each.")] = 7,
    folder: Models = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure smooth shadow boundaries: Table 1 of Mattausch et al. 2012."""
    clock = Clock() if as_json or quiet else ConsoleClock()
    if output is not None:
        files.check_writable(output, (".json",))
    record = run_mattausch(models_folder(folder), frames, clock)
    report(record, output, as_json)


@app.command("stich-city")
def stich_city(
    lots: Annotated[Size, typer.Option(parser=arguments.size, metavar="AxB", help="Of the town.")] = DEFAULT_LOTS,
    triangles: Annotated[int, typer.Option(min=1, metavar="N", help="In all.")] = 200_000,
    tree: Annotated[int, typer.Option(min=0, metavar="N", help="Of these, in a tree in a street.")] = 0,
    method: Annotated[list[str], typer.Option(metavar="NAME", help="Repeatable; frustum and robust-gs.")] = [],  # noqa: B006
    frames: Annotated[int, typer.Option(min=1, metavar="N", help="Timed frames of each path.")] = 15,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure hierarchical culling on a walk through a town and a flight above; exit status 1 if it changes a mask."""
    clock = Clock() if as_json or quiet else ConsoleClock()
    if output is not None:
        files.check_writable(output, (".json",))
    names = method or ["frustum", "robust-gs"]
    for name in names:
        make_method(name, culling=True)
    record = run_city((lots.width, lots.height), triangles, tree, names, frames, clock)
    report(record, output, as_json)
    if record.broken:
        raise typer.Exit(1)


@app.command("pyvista")
def pyvista(
    scene: Annotated[
        list[str],
        typer.Option(metavar="NAME", help=f"One of {', '.join(pyvista_shadows.NAMES)}; repeatable."),
    ] = [],  # noqa: B006
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Count wrong pixels of PyVista's shadows and of shadow maps, beside exact ones."""
    clock, _ = begin(None, output, as_json or quiet)
    names = known(scene, dict.fromkeys(pyvista_shadows.NAMES))
    finish(pyvista_shadows.run_pyvista(names, pyvista_shadows.SIZES, clock), output, as_json)


@app.command()
def check() -> None:
    """Compare with Embree on one small scene, in one line."""
    embree = MitsubaRunner()
    missing = embree.unavailable()
    if missing is not None:
        print(f"not compared with Embree: {missing}")
        return
    benchmark = Benchmark([CHECK_SCENE], ["point"], [CHECK_SIZE], CHECK_RUNS, CHECK_SAMPLES, [*exact_methods(), embree])
    record = _carry_out(benchmark, None, None, Clock())
    for one in bars(record):
        if one.cold is not None and one.warm is not None:
            print(f"{one.runner.name} beside Embree on {one.case}: {one.cold:.2f} x cold, {one.warm:.2f} x warm")
    for text in table.broken(record):
        print(text)
    if record.broken:
        raise typer.Exit(1)


def _carry_out(benchmark: Benchmark, output: Path | None, resume: Path | None, clock: Clock) -> Record:
    record = benchmark.record()
    file = resume or output
    if file is not None:
        files.check_writable(file, (".json",))
    if resume is not None:
        earlier = Record.load(resume)
        record.check_same(resume, earlier)
        record = earlier

    def keep(latest: Record) -> None:
        nonlocal record
        record = latest
        if file is not None:
            latest.save(file)

    methods = [METHODS[runner.name]() for runner in benchmark.runners if runner.name in METHODS]
    compile_kernels([*methods, METHODS["oracle"]()], 1, clock)
    try:
        return benchmark.run(record, keep, clock)
    except KeyboardInterrupt:
        if file is not None and record.cases:
            note(f"finished cases are kept ({len(record.cases)}): go on with --resume {file}")
        raise


def _scenes(names: list[str], full: bool) -> list[str]:
    for name in names:
        if name not in SCENES:
            raise OptionError(f"unknown scene {name!r} (known: {', '.join(SCENES)})")
    return list(dict.fromkeys(names)) or list(FULL if full else QUICK)


def _lights(kind: str) -> list[str]:
    if kind not in (*LIGHTS, "both"):
        raise OptionError(f"--light: wanted point, directional or both, got {kind!r}")
    return list(LIGHTS) if kind == "both" else [kind]


def _sizes(texts: str) -> list[tuple[int, int]]:
    try:
        sizes = [arguments.size(text) for text in texts.split(",")]
    except typer.BadParameter as error:
        raise OptionError(f"--resolution: {error.message}") from None
    for size in sizes:
        if max(size) > MAX_SIDE_PX:
            raise OptionError(f"--resolution: wanted 1 to {MAX_SIDE_PX} pixels a side, got {size.width}x{size.height}")
    return [(size.width, size.height) for size in dict.fromkeys(sizes)]
