"""Results of any benchmark, read back: as documents that are known to be whole, and as times by name."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from umbrae.bench.record import SCHEMA
from umbrae.errors import InputError
from umbrae.files import load_text

_Times = Iterator[tuple[str, Sequence[float]]]


@dataclass(frozen=True)
class Result:
    """A file that `umbrae bench ... -o` wrote; `document` is its JSON."""

    path: Path
    document: Mapping[str, Any]

    @property
    def benchmark(self) -> str:
        """The command's name."""
        return str(self.document["benchmark"])

    @property
    def machine(self) -> str:
        """What it ran on, in a line."""
        machine = self.document["machine"]
        parts = [str(machine["cpu"]), f"{machine['threads']} of {machine['cores']} cores"]
        if machine.get("opengl"):
            parts.append(f"OpenGL on {machine['opengl']}")
        commit = str(machine.get("commit") or "")[:7]
        changed = " with changes" if machine.get("dirty") else ""
        return ", ".join([*parts, str(self.document["date"])[:10], *([f"commit {commit}{changed}"] if commit else [])])

    @property
    def frames(self) -> bool:
        """Whether the runs are frames of a flight, or suns, which differ in what there is to do; else repetitions."""
        if self.benchmark == "rays":
            return self.document["configuration"].get("path") is not None
        return self.benchmark != "mattausch"

    def times(self) -> dict[str, list[float]]:
        """Seconds of every run of what was measured, by name; the name tells everything that has to be the same.

        Raises
        ------
        InputError
            For a document that lacks something, or has times that are none.
        """
        try:
            found = {name: [float(value) for value in values] for name, values in _times_of(self)(self.document)}
            for name, seconds in found.items():
                if not all(math.isfinite(value) and value > 0 for value in seconds):
                    raise ValueError(f"seconds of {name}")
            return {name: seconds for name, seconds in found.items() if seconds}
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            raise damaged(self.path, error) from error


def load_result(path: Path) -> Result:
    """Read a result of any benchmark.

    Raises
    ------
    InputError
        For a file that is missing, is no JSON, or is no result of `umbrae bench`.
    """
    try:
        document = json.loads(load_text(path))
        if not isinstance(document, dict) or document.get("schema") != SCHEMA:
            raise InputError(f"{path}: wanted a result of umbrae bench of schema {SCHEMA}")
        result = Result(path, document)
        if result.benchmark not in _TIMES and "sweep" not in document:
            raise InputError(f"{path}: unknown benchmark {result.benchmark[:40]!r}")
        _ = result.machine, result.frames
        return result
    except InputError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise damaged(path, error) from error


def damaged(path: Path, error: Exception) -> InputError:
    """What to raise for a document that lacks something."""
    text = " ".join(str(error).split())[:120]
    return InputError(f"{path}: damaged, or no result of umbrae bench: {type(error).__name__} {text}")


def _rays(document: Mapping[str, Any]) -> _Times:
    path = document["configuration"].get("path")
    along = "" if path is None else f" along {path['name']}"
    for result in document["cases"]:
        case = result["case"]
        about = f"{case['scene']}, {case['light']}, {case['width']}x{case['height']}{along}"
        for runner in result["runners"]:
            for kind in ("cold", "warm"):
                if kind in runner["seconds"]:
                    yield f"{about}: {runner['name']}, {kind}", runner["seconds"][kind]["runs"]


def _sun(document: Mapping[str, Any]) -> _Times:
    about = f"{document['scene']}, {document['sensors']:,} sensors, {document['suns']} suns"
    for run in document["runs"]:
        yield f"{about}: {run['name']}", run["trace_seconds"]


def _mattausch(document: Mapping[str, Any]) -> _Times:
    for run in document["runs"]:
        for name, light in (("rebuilt", "moving"), ("kept", "resting")):
            about = f"{run['model']}: {run['method']}, {run['silhouette']}, {light} light"
            yield about, run[f"{name}_seconds"]


def _city(document: Mapping[str, Any]) -> _Times:
    about = f"{'x'.join(map(str, document['lots']))} lots, {document['triangles']:,} triangles"
    for run in document["runs"]:
        for name, key in (("culling", "seconds"), ("no culling", "plain_seconds")):
            yield f"{about}, {run['path']}: {run['method']}, {name}", run[key]


def _sweep(document: Mapping[str, Any]) -> _Times:
    size = document["sweep"]["size"]
    about = "" if size is None else f", {'x'.join(map(str, size))}"
    for cell in document["cells"]:
        yield f"{cell['column']}{about}: {cell['row']}", cell["seconds"]


_TIMES: Mapping[str, Callable[[Mapping[str, Any]], _Times]] = {
    "rays": _rays, "sun": _sun, "mattausch": _mattausch, "stich-city": _city,
}  # fmt: skip


def _times_of(result: Result) -> Callable[[Mapping[str, Any]], _Times]:
    return _TIMES.get(result.benchmark, _sweep)
