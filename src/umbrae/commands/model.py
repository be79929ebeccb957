"""The model that a command is about, with notes on what is special about it."""

from collections.abc import Sequence
from pathlib import Path

import umbrae as um
from umbrae.clock import Clock
from umbrae.console import note


def load(
    model: Path, clock: Clock, written: Sequence[Path] = (), opaque: bool = False, crease: float | None = None
) -> um.Scene:
    """Read a model; `written` are the outputs, none of which may be one of its textures.

    `crease` is the angle of `Scene.smoothed`; None leaves normals as they are.
    """
    scene = um.load(model, clock, written)
    if opaque:
        scene = scene.opaque()
    if crease is not None:
        with clock.span("normals"):
            scene = scene.smoothed(crease)
    return scene


def note_if_nothing_is_smooth(scene: um.Scene, wanted: bool) -> None:
    """Smooth shadows and outlines of a model without normals are those of its triangles."""
    if wanted and scene.normals is None:
        note("the model has no vertex normals, so nothing is smooth: --smooth-normals makes some")


def note_if_nothing_is_seen(samples: um.ViewSamples) -> None:
    """A picture of nothing is no mistake, but hardly what was wanted."""
    if not samples.covered.any():
        note("the camera sees nothing of the model")
