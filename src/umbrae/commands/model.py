"""The model that a command is about, with notes on what is special about it."""

from collections.abc import Sequence
from pathlib import Path

import umbrae as um
from umbrae.clock import Clock
from umbrae.console import note


def load(model: Path, clock: Clock, written: Sequence[Path] = (), opaque: bool = False) -> um.Scene:
    """Read a model; `written` are the outputs, none of which may be one of its textures."""
    scene = um.load(model, clock, written)
    return scene.opaque() if opaque else scene


def note_if_nothing_is_seen(samples: um.ViewSamples) -> None:
    """A picture of nothing is no mistake, but hardly what was wanted."""
    if not samples.covered.any():
        note("the camera sees nothing of the model")
