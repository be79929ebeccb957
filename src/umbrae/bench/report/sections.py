"""Each benchmark's result as a section of the page."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from umbrae.bench.mattausch import KINDS, PAPER
from umbrae.bench.report.section import Curve, Grid, Plot, Section
from umbrae.bench.report.sweep_section import sweep_section
from umbrae.bench.results import Result, case_name, damaged
from umbrae.bench.sweep import SweepRecord

_KINDS = ("cold", "warm")


def section(result: Result) -> Section:
    """What to show of a result.

    Raises
    ------
    InputError
        For a document that lacks something.
    """
    make = _SECTIONS.get(result.benchmark)
    if make is None:
        return sweep_section(SweepRecord.load(result.path), result.machine)
    try:
        return make(result)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise damaged(result.path, error) from error


def _rays(result: Result) -> Section:
    """Times of all runners in each case, in multiples of Embree's; wrong samples beside the time."""
    rows = []
    triangles: dict[str, list[tuple[float, float]]] = {}
    wrong: dict[str, list[tuple[float, float]]] = {}
    for case in result.document["cases"]:
        name = case_name(case["case"])
        for runner in (runner for runner in case["runners"] if runner["seconds"]):
            cold, warm = (float(runner["seconds"][kind]["median"]) for kind in _KINDS)
            share = runner["wrong"] / max(1, runner["checked"])
            rows.append((name, runner["name"], _ms(cold), _ms(warm), _share(share)))
            wrong.setdefault(runner["name"], []).append((1e3 * cold, 100 * share))
            if (case["case"]["width"], case["case"]["light"]) == (1920, "point"):
                triangles.setdefault(runner["name"], []).append((float(case["triangles"]), 1e3 * cold))
    plots = (
        Plot(
            "Point light, 1920 x 1080: geometry new in every run", "triangles", "milliseconds",
            [Curve(name, sorted(points)) for name, points in triangles.items()],
        ),
        Plot(
            "Wrong samples beside time, all cases", "milliseconds, cold", "% of samples wrong",
            [Curve(name, points) for name, points in wrong.items()], joined=False, logarithmic=(True, False),
        ),
    )  # fmt: skip
    grid = Grid("Medians", ("case", "", "cold ms", "warm ms", "wrong"), rows)
    note = (
        "Cold: geometry new in every run, its preparation included. Warm: camera and light new. Wrong: of the samples "
        "that were checked."
    )
    title = "Exact shadows beside rays"
    return Section(result.benchmark, title, result.machine, (grid,), plots, (note, *_not_run_cases(result.document)))


def _not_run_cases(document: Mapping[str, Any]) -> Sequence[str]:
    found = [(case_name(case["case"]), case["not_run"]) for case in document["cases"]]
    found += [(runner["name"], runner["not_run"]) for case in document["cases"] for runner in case["runners"]]
    return _not_run(found)


def _not_run(found: Sequence[tuple[str, str | None]]) -> list[str]:
    return list(dict.fromkeys(f"{name} not run: {reason}" for name, reason in found if reason))


def _sun(result: Result) -> Section:
    document = result.document
    verdicts = document["sensors"] * document["suns"]
    rows = []
    for run in (run for run in document["runs"] if run["trace_seconds"]):
        trace = sum(run["trace_seconds"])
        rows.append((
            run["name"], f"{run['prepare_seconds']:.3f}", f"{trace:.2f}", f"{verdicts / trace:,.0f}",
            _share(run["differ"] / max(1, run["asked"])),
        ))  # fmt: skip
    head = ("", "prepare s", "trace s", "verdicts a second", "differ from the exact")
    title = f"Sensors and suns: {document['sensors']:,} x {document['suns']} on {document['scene']}"
    notes = _not_run([(run["name"], run["not_run"]) for run in document["runs"]])
    return Section(result.benchmark, title, result.machine, (Grid("Whole study", head, rows),), (), notes)


def _mattausch(result: Result) -> Section:
    rows, dim, base = [], set(), 1.0
    for run in (run for run in result.document["runs"] if run["rebuilt_seconds"]):
        anew, kept = (float(np.median(run[f"{name}_seconds"])) for name in ("rebuilt", "kept"))
        base = anew if run["silhouette"] == KINDS[0] else base
        about = (run["model"], run["method"], run["silhouette"])
        rows.append((*about, _ms(anew), _ms(kept), f"{anew / base:.2f}", f"{kept / base:.2f}"))
        if run["method"] == "smooth-gl":
            name, theirs_anew, theirs_kept = PAPER[run["model"]]
            place = KINDS.index(run["silhouette"])
            ratios = (theirs[place] / theirs_anew[0] for theirs in (theirs_anew, theirs_kept))
            dim.add(len(rows))
            rows.append((f"paper: {name}", "", run["silhouette"], "", "", *(f"{ratio:.2f}" for ratio in ratios)))
    head = ("model", "method", "silhouette", "moving light ms", "resting light ms", "ratio, moving", "ratio, resting")
    grid = Grid("Ratios to the discrete silhouette under a moving light", head, rows, frozenset(dim))
    notes = _not_run([(f"{run['model']}, {run['method']}", run["not_run"]) for run in result.document["runs"]])
    return Section(
        result.benchmark, "Smooth boundaries (Mattausch et al. 2012, Table 1)", result.machine, (grid,), (), notes
    )


def _city(result: Result) -> Section:
    document = result.document
    rows = []
    for run in (run for run in document["runs"] if run["seconds"]):
        culled, plain = (float(np.median(run[key])) for key in ("seconds", "plain_seconds"))
        rows.append((
            run["path"], run["method"], f"{np.mean(run['culled']) / document['triangles']:.0%}",
            _ms(culled), _ms(plain), f"{plain / culled:.2f}", _ms(max(run["seconds"])), _ms(max(run["plain_seconds"])),
            f"{np.mean(run['queries']):.0f}",
        ))  # fmt: skip
    head = ("path", "method", "culled", "ms", "without ms", "gain", "worst ms", "worst without", "boxes asked")
    title = f"Culling in a town of {document['triangles']:,} triangles (Stich et al. 2007)"
    notes = _not_run([(f"{run['path']}, {run['method']}", run["not_run"]) for run in document["runs"]])
    wrong = [
        f"{run['path']}, {run['method']}: culling changes {run['differ']:,} samples"
        for run in document["runs"]
        if run["differ"]
    ]
    grid = Grid("Each frame with culling and without; the masks are compared", head, rows)
    return Section(result.benchmark, title, result.machine, (grid,), (), notes, wrong)


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.1f}"


def _share(share: float) -> str:
    return "0" if share == 0 else f"{100 * share:.3f} %"


_SECTIONS: Mapping[str, Callable[[Result], Section]] = {
    "rays": _rays, "sun": _sun, "mattausch": _mattausch, "stich-city": _city,
}  # fmt: skip
