"""What `umbrae render --show` draws: a volume method is asked, and `show` makes a figure of its answers."""

import enum
import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np
import typer
from numpy.typing import NDArray

import umbrae as um
from umbrae import show
from umbrae.arguments import Vector
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry.edges import edges, weld
from umbrae.geometry.volume_faces import facing_of_all, multiplicity
from umbrae.memory import require
from umbrae.methods import METHODS, Method
from umbrae.methods.volumes.caster import VolumeCaster
from umbrae.methods.volumes.method import VolumeMethod
from umbrae.shade import shade

_BYTES_PER_SAMPLE = 90


class Show(enum.StrEnum):
    """The counter in false colour, or the volumes as translucent layers."""

    COUNT = "count"
    VOLUMES = "volumes"


def kind_of(text: str) -> Show:
    """What `--show` asks for."""
    if text not in list(Show):
        raise typer.BadParameter(f"wanted {' or '.join(Show)}, got {text!r}")
    return Show(text)


def check(kind: Show, method: Method, lights: int, samples_per_pixel: int, others: Collection[object]) -> None:
    """Refuse what no figure can be made of; `others` are the outputs that there may be beside a picture."""
    if not isinstance(method, VolumeMethod):
        having = ", ".join(name for name, known in METHODS.items() if issubclass(known, VolumeMethod))
        raise OptionError(f"--show {kind}: method {method.name} has no volumes (these have: {having})")
    if lights > 1:
        raise OptionError(f"--show {kind}: wanted one light, got {lights}")
    if math.isqrt(samples_per_pixel) ** 2 != samples_per_pixel:
        raise OptionError(
            f"--show {kind}: wanted a square number of samples per pixel such as 1, 4 or 9, got {samples_per_pixel}"
        )
    if any(others):
        raise OptionError(f"--show {kind} draws a figure, which has no --mask and no --npz")


def picture_height(kind: Show, width: int, height: int) -> int:
    """Pixels of height that the legend leaves of a figure."""
    left = height - show.legend_height(width) if kind is Show.COUNT else height
    if left < 1:
        raise OptionError(f"--size: wanted more than {height - left} pixels of height, which the legend takes")
    return left


def figure(
    kind: Show,
    scene: um.Scene,
    camera: um.Camera,
    light: um.Light,
    method: Method,
    samples_per_pixel: int,
    up: Vector,
    clock: Clock,
) -> um.Image:
    """The figure with the samples and the mask behind it, which are those of a finer picture."""
    fine = math.isqrt(samples_per_pixel)
    finer = replace(camera, width=camera.width * fine, height=camera.height * fine)
    with clock.span("sample"):
        samples = um.sample(scene, finer, clock=clock)
    require(samples.size * _BYTES_PER_SAMPLE, f"a figure of {camera.width} x {camera.height} pixels")
    with clock.span("prepare"):
        caster = method.prepare(scene, clock)
    assert isinstance(caster, VolumeCaster)
    with clock.span("shadow"):
        mask = caster.shadow(light, samples, clock)
    shadows = mask if kind is Show.VOLUMES else um.ShadowMask(np.zeros(samples.shape, bool), um.Guarantee.NONE)
    with clock.span("shade"):
        picture = shade(scene, finer, [light], samples, [shadows], up, clock)
    with clock.span("show"):
        if kind is Show.COUNT:
            image = show.count(picture, caster.count(light, samples), samples.covered, fine)
        else:
            assert samples.depth is not None
            image = show.volumes(
                picture,
                caster.faces_before(light, samples),
                caster.faces_before(light, samples, outlines=True),
                show.silhouette_lines(_silhouettes(scene, light), finer.world_to_clip, finer.near, samples.depth, fine),
                samples.covered,
                fine,
            )
    return replace(image, samples=samples, masks=(mask,))


def _silhouettes(scene: um.Scene, light: um.Light) -> NDArray[np.float32]:
    """`(e, 2, 3)` the ends of all edges whose multiplicity is not zero."""
    ids = weld(scene.positions)
    topology = edges(ids[scene.triangles])
    place = np.empty((int(ids.max(initial=-1)) + 1, 3), np.float32)
    place[ids] = scene.positions
    facing = facing_of_all(scene.positions, scene.triangles, light.position)
    found: NDArray[np.float32] = place[topology.vertices[multiplicity(topology, facing) != 0]]
    return found
