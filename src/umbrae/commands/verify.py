"""`umbrae verify`: random samples of a picture against the oracle, for one method or for all."""

from dataclasses import dataclass
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

import umbrae as um
from umbrae import arguments, info
from umbrae.clock import Clock
from umbrae.commands.model import load, note_if_nothing_is_seen
from umbrae.console import ConsoleClock, one_line, print_json
from umbrae.errors import OptionError, UmbraeError
from umbrae.methods import METHODS, Method, make_method
from umbrae.options import (
    DEFAULT_SIZE,
    DEFAULT_UP,
    Counter,
    Counting,
    Culling,
    Determinism,
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
    Model,
    Opaque,
    Points,
    Quiet,
    SizeOption,
    SunDiameter,
    Suns,
    Target,
    Up,
    given,
    of_shadow_map,
)
from umbrae.transmission import transmission_of
from umbrae.verify import Truth
from umbrae.warmup import try_out

EVERY, JUDGE = "all", "oracle"


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a method under one light: a verdict on its mask, or the reason why there is none.

    `shares` says whether a part of the light may arrive, so that masks hold shares of it.
    """

    method: Method
    seconds: float
    guarantee: um.Guarantee
    verdict: um.Verdict | None
    reason: str | None = None
    shares: bool = False

    @property
    def broken(self) -> bool:
        """Whether a promise was made and not kept."""
        return self.verdict is not None and not self.verdict.ok and self.guarantee is not um.Guarantee.NONE

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the verdict's numbers, or the reason."""
        if self.verdict is None:
            return {"reason": self.reason}
        names = ["checked", "mismatches", "outside_band", "inside_band", "worst_margin"]
        if self.shares:
            names.append("worst_transmittance")
        return {name: getattr(self.verdict, name) for name in names} | {"classes": dict(self.verdict.classes)}


def verify(
    model: Model,
    method: Annotated[
        str, typer.Option("--method", metavar="NAME|all", help="See `umbrae methods`; each in turn but the oracle.")
    ] = "frustum",
    counting: Counting = None,
    determinism: Determinism = None,
    counter: Counter = None,
    culling: Culling = None,
    map_size: MapSize = None,
    map_bias: MapBias = None,
    map_slope_bias: MapSlopeBias = None,
    map_filter: MapFilter = None,
    map_projection: MapProjection = None,
    count: Annotated[int, typer.Option(min=1, metavar="N", help="Samples to check.")] = 20_000,
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
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Of the random choice of samples.")] = 0,
    opaque: Opaque = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare random samples of a picture with the oracle; exit status 1 if a method breaks its guarantee."""
    clock = Clock() if as_json or quiet else ConsoleClock()
    every = method == EVERY
    options = given(
        counting=counting, determinism=determinism, counter=counter, culling=culling, light_samples=light_samples
    )
    options |= of_shadow_map(
        method, size=map_size, bias=map_bias, slope_bias=map_slope_bias, filter=map_filter, projection=map_projection
    )
    algorithms = _algorithms(method, options)
    judge = make_method(JUDGE, **given(light_samples=light_samples))
    arguments.check_light_samples(light_samples, light_radius, sun_diameter)
    scene = load(model, clock, opaque=opaque)
    camera = arguments.camera(scene, size, eye, target, up, fov)
    lights = arguments.lights(scene, camera, light, sun, up, light_radius, sun_diameter)
    soft = any(one.is_area for one in lights)
    hindrances = try_out([*algorithms, judge], 1, clock, transmission_of(scene) is not None, area=soft)
    for hindrance in hindrances:
        if hindrance is not None and not (every and isinstance(hindrance, UmbraeError)):
            raise hindrance
    with clock.span("sample"):
        samples = um.sample(scene, camera, clock=clock)
    note_if_nothing_is_seen(samples)
    judged: list[list[Outcome]] = []
    for one in lights:
        with clock.span(JUDGE):
            truth = Truth.find(scene, one, samples, count, seed, clock, judge.light_samples)
        judged.append(
            [
                _outcome(algorithm, truth, hindrance, every, clock)
                for algorithm, hindrance in zip(algorithms, hindrances, strict=False)
            ]
        )
    if as_json:
        _print_json(str(model), method, seed, scene, lights, judged, clock)
    elif every:
        for one, outcomes in zip(lights, judged, strict=True):
            _print_table(_place(scene, one), outcomes)
    else:
        for one, (outcome,) in zip(lights, judged, strict=True):
            assert outcome.verdict is not None
            light_off = f", light off by {outcome.verdict.worst_transmittance:.2g} at most" if outcome.shares else ""
            print(
                f"{_place(scene, one)}: {outcome.verdict.checked:,} samples, {outcome.verdict.outside_band:,} wrong "
                f"outside the band, {outcome.verdict.inside_band:,} inside, "
                f"worst margin {outcome.verdict.worst_margin:.3g}{light_off}"
            )
    if any(outcome.broken for outcomes in judged for outcome in outcomes):
        raise typer.Exit(1)


def _algorithms(method: str, options: dict[str, Any]) -> list[Method]:
    """One method, or all but the judge; of the options, those get each that have it, and one of them must."""
    if method != EVERY:
        return [make_method(method, **options)]
    made = [make_method(name) for name in METHODS if name != JUDGE]
    for option in options:
        if not any(option in one.options() for one in made):
            raise OptionError(f"no method has an option {option}")
    return [make_method(one, **{o: v for o, v in options.items() if o in one.options()}) for one in made]


def _outcome(method: Method, truth: Truth, hindrance: Exception | None, every: bool, clock: Clock) -> Outcome:
    """Shadows by one method, judged; when all are, one that cannot does not stop the rest."""
    if hindrance is not None:
        return Outcome(method, 0.0, method.guarantee, None, one_line(str(hindrance)))
    try:
        with clock.span(method.name):
            mask = um.shadow(truth.scene, truth.light, truth.samples, method=method, clock=clock)
    except UmbraeError as error:
        if not every:
            raise
        return Outcome(method, clock.spans[-1][1], method.guarantee, None, one_line(str(error)))
    seconds, verdict = clock.spans[-1][1], truth.judge(mask)
    return Outcome(method, seconds, mask.guarantee, verdict, shares=truth.transmittance is not None)


def _place(scene: um.Scene, light: um.Light) -> str:
    """Where a light is, in the file's own coordinates."""
    if light.is_directional:
        return f"sun towards {info.triple(light.position[:3], 6)}"
    digits = info.FAR_DIGITS if scene.origin.any() else 6
    return f"light at {info.triple(light.position[:3] + scene.origin, digits)}"


def _print_table(place: str, outcomes: list[Outcome]) -> None:
    """A row for each verdict, a line for each reason why there is none. All have judged the same samples."""
    verdicts = [(outcome, outcome.verdict) for outcome in outcomes if outcome.verdict is not None]
    classes = list(dict.fromkeys(name for _, verdict in verdicts for name in verdict.classes))
    rows = Table(box=None, pad_edge=False, collapse_padding=True)
    rows.add_column("method", no_wrap=True)
    rows.add_column("guarantee", no_wrap=True)
    shares = ["light off"] if any(outcome.shares for outcome, _ in verdicts) else []
    for name in ("outside band", "inside band", *classes, *shares, "worst margin", "seconds"):
        rows.add_column(name.replace(" ", "\n", 1), justify="right", vertical="bottom")
    for outcome, verdict in verdicts:
        rows.add_row(
            outcome.method.name,
            outcome.guarantee,
            f"{verdict.outside_band:,}",
            f"{verdict.inside_band:,}",
            *(f"{verdict.classes[name]:,}" if name in verdict.classes else "" for name in classes),
            *(f"{verdict.worst_transmittance:.2g}" for _ in shares),
            f"{verdict.worst_margin:.2g}",
            f"{outcome.seconds:.2f}",
        )
    checked = max((verdict.checked for _, verdict in verdicts), default=0)
    print(f"{place}: wrong of {checked:,} samples")
    Console(highlight=False).print(rows)
    reasons: dict[str, list[str]] = {}
    for outcome in outcomes:
        if outcome.reason is not None:
            reasons.setdefault(outcome.reason, []).append(outcome.method.name)
    for reason, names in reasons.items():
        print(f"not judged: {', '.join(names)}: {reason}")


def _print_json(
    model: str,
    method: str,
    seed: int,
    scene: um.Scene,
    lights: list[um.Light],
    judged: list[list[Outcome]],
    clock: Clock,
) -> None:
    found: list[dict[str, Any]] = []
    for light, outcomes in zip(lights, judged, strict=True):
        about: dict[str, Any] = {"position": light.position.tolist()}
        if method == EVERY:
            about["methods"] = [
                {
                    "method": outcome.method.name,
                    "options": outcome.method.options(),
                    "guarantee": outcome.guarantee,
                    "seconds": outcome.seconds,
                    **outcome.as_dict(),
                }
                for outcome in outcomes
            ]
        else:
            about |= outcomes[0].as_dict()
        found.append(about)
    print_json(
        model=model, method=method, seed=seed, origin=scene.origin.tolist(), lights=found, seconds=clock.seconds()
    )
