"""Results of any benchmark, read back: as documents that are known to be whole, and as times by name."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from umbrae.bench.record import SCHEMA
from umbrae.errors import InputError
from umbrae.files import load_text


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
        return ", ".join([*parts, str(self.document["date"])[:10], *([f"commit {commit}"] if commit else [])])

    def times(self) -> dict[str, list[float]]:
        """Seconds of every run of what was measured, by name."""
        try:
            found = _TIMES[self.benchmark if self.benchmark in _TIMES else "sweep"](self.document)
            return {name: [float(value) for value in values] for name, values in found.items() if len(values)}
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
        if document["schema"] != SCHEMA:
            raise InputError(f"{path}: wanted a result of umbrae bench of schema {SCHEMA}")
        result = Result(path, document)
        assert result.benchmark and result.machine
        return result
    except InputError:
        raise
    except (AssertionError, AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: no result of umbrae bench: {type(error).__name__} {error}") from error


def damaged(path: Path, error: Exception) -> InputError:
    """What to raise for a document that lacks something."""
    return InputError(f"{path}: damaged result of umbrae bench: {type(error).__name__} {error}")


def case_name(case: Mapping[str, Any]) -> str:
    """A case of `umbrae bench rays` in words."""
    return f"{case['scene']}, {case['light']}, {case['width']}x{case['height']}"


def _rays(document: Mapping[str, Any]) -> dict[str, Any]:
    return {
        f"{case_name(result['case'])}: {runner['name']}, {kind}": runner["seconds"][kind]["runs"]
        for result in document["cases"]
        for runner in result["runners"]
        for kind in ("cold", "warm")
        if kind in runner["seconds"]
    }


def _sun(document: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{run['name']}, a sun": run["trace_seconds"] for run in document["runs"]}


def _mattausch(document: Mapping[str, Any]) -> dict[str, Any]:
    return {
        f"{run['model']}, {run['method']}, {run['silhouette']}, {name}": run[f"{name}_seconds"]
        for run in document["runs"]
        for name in ("rebuilt", "kept")
    }


def _city(document: Mapping[str, Any]) -> dict[str, Any]:
    return {
        f"{run['path']}, {run['method']}, {name}": run[key]
        for run in document["runs"]
        for name, key in (("culling", "seconds"), ("no culling", "plain_seconds"))
    }


def _sweep(document: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{cell['column']}: {cell['row']}": cell["seconds"] for cell in document["cells"]}


_TIMES = {"rays": _rays, "sun": _sun, "mattausch": _mattausch, "stich-city": _city, "sweep": _sweep}
