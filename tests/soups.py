"""The tiny scenes of `scenes/`, each with answers that were found by thinking."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.light import Light
from umbrae.material import Material
from umbrae.samples import ViewSamples, surface_positions
from umbrae.scene import Scene
from umbrae.transmission import transmission_of

FOLDER = Path(__file__).parents[1] / "scenes"


@dataclass(frozen=True)
class Answer:
    """One point, one light, and whether it lies in shadow; `triangle` is -1 for a free point.

    `transmittance` is the share of light that arrives of red, green and blue.
    """

    light: tuple[float, float, float, float]
    triangle: int
    barycentric: tuple[float, float]
    side: int
    point: tuple[float, float, float]
    in_shadow: bool
    transmittance: tuple[float, float, float]
    why: str


@dataclass(frozen=True)
class Soup:
    """A scene, what is known about it, and a place to look at it from."""

    name: str
    why: str
    scene: Scene
    answers: tuple[Answer, ...]
    eye: tuple[float, float, float]
    target: tuple[float, float, float]

    def questions(self) -> Iterator[tuple[Light, ViewSamples, tuple[Answer, ...]]]:
        """All answers under one light at a time, with the samples `(n,)` they are about."""
        for position in dict.fromkeys(answer.light for answer in self.answers):
            answers = tuple(answer for answer in self.answers if answer.light == position)
            yield Light(np.array(position)), samples_of(self.scene, answers), answers


def samples_of(scene: Scene, answers: tuple[Answer, ...]) -> ViewSamples:
    """The points of answers as one list, free ones and those on triangles together."""
    triangle = np.array([answer.triangle for answer in answers], np.int32)
    barycentric = np.array([answer.barycentric for answer in answers], np.float32)
    position: NDArray[np.float32] = np.array([answer.point for answer in answers], np.float32)
    own = triangle >= 0
    position[own] = surface_positions(scene, triangle[own], barycentric[own])
    side = np.array([answer.side for answer in answers], np.int8)
    return ViewSamples(triangle, barycentric, side, position, np.ones(len(answers), bool))


def load_soup(path: Path) -> Soup:
    """Read one file of `scenes/`; the format is described in its README."""
    data = json.loads(path.read_text(encoding="utf-8"))
    positions = np.array(data["positions"], np.float64).reshape(-1, 3)
    triangles = np.array(data["triangles"], np.int32).reshape(-1, 3)
    single = positions.astype(np.float32)
    assert (single == positions).all(), f"{path.name}: a coordinate is no float32 number"
    # float32 on purpose: a scene far from zero must stay there
    scene = Scene(
        single,
        triangles,
        [_material(row) for row in data.get("materials", [])],
        data.get("material_id"),
        uv=data.get("uv"),
        colors=data.get("colors"),
    )
    answers = tuple(_answer(row) for row in data["answers"])
    return Soup(data["name"], data["why"], scene, answers, tuple(data["eye"]), tuple(data["target"]))


def _material(row: dict[str, Any]) -> Material:
    texture = row.get("texture")
    return Material(**{**row, "texture": None if texture is None else np.array(texture, np.uint8)})


def _answer(row: dict[str, Any]) -> Answer:
    dark = row["in_shadow"]
    transmittance = tuple(row.get("transmittance", (0.0, 0.0, 0.0) if dark else (1.0, 1.0, 1.0)))
    assert dark == (not any(transmittance)), f"{row['why']}: it is dark where no light of any colour arrives"
    return Answer(
        light=tuple(row["light"]),
        triangle=row.get("triangle", -1),
        barycentric=tuple(row.get("barycentric", (0.0, 0.0))),
        side=row.get("side", 0),
        point=tuple(row.get("point", (0.0, 0.0, 0.0))),
        in_shadow=dark,
        transmittance=transmittance,
        why=row["why"],
    )


SOUPS: dict[str, Soup] = {path.stem: load_soup(path) for path in sorted(FOLDER.glob("*.json"))}

TRANSPARENT = {name for name, soup in SOUPS.items() if transmission_of(soup.scene) is not None}
"""Those whose casters let light through."""
