"""Each benchmark's result as a section of the page."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from umbrae.bench.mattausch import KINDS, PAPER
from umbrae.bench.record import Record
from umbrae.bench.report.rays_section import rays_section
from umbrae.bench.report.section import Curve, Grid, Plot, Section
from umbrae.bench.report.sweep_section import sweep_section
from umbrae.bench.results import Result, damaged
from umbrae.bench.sweep import SweepRecord


def section(result: Result) -> Section:
    """What to show of a result.

    Raises
    ------
    InputError
        For a document that lacks something.
    """
    make = _SECTIONS.get(result.benchmark, _sweep)
    try:
        made = make(result)
        if not all(isinstance(text, str) for text in (made.title, *made.notes)):
            raise TypeError("a title or a note is no text")
        return made
    except (AttributeError, IndexError, KeyError, TypeError, ZeroDivisionError) as error:
        raise damaged(result.path, error) from error


def _rays(result: Result) -> Section:
    return rays_section(Record.load(result.path), result.machine)


def _sweep(result: Result) -> Section:
    return sweep_section(SweepRecord.load(result.path), result.machine)


def _sun(result: Result) -> Section:
    document = result.document
    verdicts = document["sensors"] * document["suns"]
    rows, curves, wrong = [], [], []
    for run in document["runs"]:
        share = run["differ"] / max(1, run["asked"])
        if run["guarantee"] == "exact" and run["differ"] + run["wrong"] > 0:
            wrong.append(
                f"{run['name']}: {run['wrong']:,} of {run['checked']:,} verdicts differ from the oracle, "
                f"{run['differ']:,} of {run['asked']:,} from the first method"
            )
        if run["trace_seconds"]:
            trace = sum(run["trace_seconds"])
            times = f"{run['prepare_seconds']:.3f}", f"{trace:.2f}", f"{verdicts / trace:,.0f}"
            rows.append((run["name"], *times, f"{100 * share:.4f}"))
            curves.append(Curve(run["name"], [(trace, 100 * share)]))
    head = ("", "prepare s", "trace s", "verdicts a second", "differ, %")
    grid = Grid("Whole study; verdicts that differ from the exact ones", head, rows)
    plots = [Plot("Verdicts that differ beside time", "seconds to trace", "% of verdicts", curves, joined=False)]
    title = f"Sensors and suns: {document['sensors']:,} x {document['suns']} on {document['scene']}"
    missing = _missing([(run["name"], run["not_run"]) for run in document["runs"]])
    return Section(result.benchmark, title, [result.machine], [grid], plots, [], missing, wrong)


def _mattausch(result: Result) -> Section:
    """Milliseconds of each silhouette, and ratios to the discrete one made anew."""
    lights = {"rebuilt": "moving light", "kept": "resting light"}
    medians: dict[tuple[str, str], dict[tuple[str, str], float]] = {}
    for run in result.document["runs"]:
        for name in lights:
            if run[f"{name}_seconds"]:
                median = 1e3 * float(np.median(run[f"{name}_seconds"]))
                medians.setdefault((run["model"], run["method"]), {})[name, run["silhouette"]] = median
    grids = []
    for place, (name, light) in enumerate(lights.items()):
        rows: list[Sequence[str]] = []
        for about, own in medians.items():
            rows.append(
                (", ".join(about), *(f"{own[name, kind]:.1f}" if (name, kind) in own else "" for kind in KINDS))
            )
        grids.append(Grid(f"Time, {light}, ms", ("model", *KINDS), rows))
        rows, dim = [], set()
        for (model, method), own in medians.items():
            base = own.get(("rebuilt", KINDS[0]))
            ratios = [own[name, kind] / base if base and (name, kind) in own else None for kind in KINDS]
            rows.append((f"{model}, {method}", *("" if ratio is None else f"{ratio:.2f}" for ratio in ratios)))
            if method == "smooth-gl":
                theirs, *told = PAPER[model]
                dim.add(len(rows))
                rows.append((f"paper: {theirs}", *(f"{value / told[0][0]:.2f}" for value in told[place])))
        caption = f"Time over that of the discrete silhouette under a moving light: {light}"
        grids.append(Grid(caption, ("model", *KINDS), rows, frozenset(dim)))
    found = [(f"{run['model']}, {run['method']}", run["not_run"]) for run in result.document["runs"]]
    title = "Smooth boundaries (Mattausch et al. 2012, Table 1)"
    return Section(result.benchmark, title, [result.machine], grids, [], [], _missing(found))


def _city(result: Result) -> Section:
    document = result.document
    rows = []
    frames: dict[str, list[Curve]] = {}
    for run in (run for run in document["runs"] if run["seconds"]):
        culled, plain = (float(np.median(run[key])) for key in ("seconds", "plain_seconds"))
        rows.append((
            f"{run['path']}, {run['method']}", f"{np.mean(run['culled']) / document['triangles']:.0%}",
            _ms(culled), _ms(plain), f"{plain / culled:.2f}", _ms(max(run["seconds"])), _ms(max(run["plain_seconds"])),
            f"{np.mean(run['queries']):.0f}",
        ))  # fmt: skip
        for name, key in ((run["path"], "seconds"), (f"{run['path']}, without culling", "plain_seconds")):
            points = [(float(frame), 1e3 * seconds) for frame, seconds in enumerate(run[key], 1)]
            frames.setdefault(run["method"], []).append(Curve(name, points))
    head = ("path", "culled", "ms", "without ms", "gain", "worst ms", "worst without", "boxes asked")
    grid = Grid("Each frame with culling and without; the masks are compared", head, rows)
    plots = [Plot(f"Time over frames, {method}", "frame", "milliseconds", found) for method, found in frames.items()]
    lots = " x ".join(map(str, document["lots"]))
    title = f"Culling in a town of {lots} lots, {document['triangles']:,} triangles (Stich et al. 2007)"
    missing = _missing([(f"{run['path']}, {run['method']}", run["not_run"]) for run in document["runs"]])
    wrong = [
        f"{run['path']}, {run['method']}: culling changes {run['differ']:,} samples"
        for run in document["runs"]
        if run["differ"]
    ]
    return Section(result.benchmark, title, [result.machine], [grid], plots, [], missing, wrong)


def _missing(found: Sequence[tuple[str, str | None]]) -> list[str]:
    return list(dict.fromkeys(f"{name} not run: {reason}" for name, reason in found if reason))


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.1f}"


_SECTIONS: Mapping[str, Callable[[Result], Section]] = {
    "rays": _rays, "sun": _sun, "mattausch": _mattausch, "stich-city": _city,
}  # fmt: skip
