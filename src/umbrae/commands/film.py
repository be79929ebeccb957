"""What `umbrae render --frames` makes: one picture after another, numbered or as a clip.

A picture holds a digest of all that it was made of. One that is there already, whole and of the same digest, is not
made again: after an interruption the same command goes on where it stopped. The pictures of a clip wait in a hidden
folder beside it until all of them are there.
"""

import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray

import umbrae as um
from umbrae import files, outputs
from umbrae.arguments import Size, Vector
from umbrae.clock import Clock
from umbrae.commands.model import load, note_if_nothing_is_seen
from umbrae.console import note, print_json
from umbrae.errors import OptionError, OutputError
from umbrae.formats.video import imageio
from umbrae.geometry.outermost import outermost
from umbrae.geometry.transforms import turning
from umbrae.methods import Caster, Method
from umbrae.shade import up_axis

_NUMBER = re.compile(r"%(0\d+)?d")
_FPS = 30.0
_MOST, _MOST_PER_SECOND = 100_000, 1000
_AROUND = 24
"""Directions from which a model must fit into the picture, where the camera goes around it."""


class Frames(NamedTuple):
    """Numbers of frames: from `first`, before `end`."""

    first: int
    end: int
    step: int

    @property
    def numbers(self) -> range:
        """All of them."""
        return range(*self)


def frames_of(text: str) -> Frames:
    """`A:B` or `A:B:STEP`."""
    found = re.fullmatch(r"(\d{1,9}):(\d{1,9})(?::(\d{1,9}))?", text)
    frames = Frames(*(int(number or 1) for number in found.groups())) if found else Frames(0, 0, 1)
    if len(frames.numbers if frames.step else ()) > _MOST:
        raise typer.BadParameter(f"wanted up to {_MOST} frames, got {text!r}")
    if frames.step == 0 or not frames.numbers:
        raise typer.BadParameter(f"wanted frames A:B or A:B:STEP, from A and before B such as 0:120, got {text!r}")
    return frames


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: the frames' folder cannot be made: {error.strerror}") from error


class Shot(NamedTuple):
    """What is in all pictures: a stand-in for everything seen, the first camera, lights, and how it is rendered."""

    stage: um.Scene
    camera: um.Camera
    lights: list[um.Light]
    method: Method
    look: Mapping[str, Any]


@dataclass(frozen=True)
class Film:
    """Which frames to make, and where to put them; `orbit` degrees per second that the camera goes around."""

    frames: Frames
    output: Path
    fps: float
    orbit: float

    @property
    def is_clip(self) -> bool:
        """Whether the pictures become one file."""
        return self.output.suffix.lower() in files.CLIPS

    @property
    def written(self) -> list[Path]:
        """The files that are there in the end."""
        return [self.output] if self.is_clip else [self.picture(number) for number in self.frames.numbers]

    @property
    def waiting(self) -> Path:
        """The folder of a clip's pictures."""
        return self.output.with_name(f".{self.output.name}.frames")

    def picture(self, number: int) -> Path:
        """The picture of a frame."""
        if self.is_clip:
            return self.waiting / f"{number:06d}.png"
        name = _NUMBER.sub(lambda found: format(number, f"{found[1] or ''}d"), self.output.name)
        return self.output.with_name(name)

    def check(self, model: Path, size: Size) -> None:
        """Refuse outputs that cannot be written, before the work starts."""
        if self.is_clip:
            if size.width % 2 or size.height % 2:
                raise OptionError(f"--size: clips take even numbers of pixels, got {size.width}x{size.height}")
            imageio()
            outputs.check_paths(model, [(self.output, files.CLIPS)])
            if self.waiting.exists() and not self.waiting.is_dir():
                raise OutputError(f"{self.waiting}: is in the way of a folder for frames")
            return
        if self.output.suffix.lower() != ".png" or len(_NUMBER.findall(self.output.name)) != 1:
            raise OutputError(f"{self.output}: wanted a name with a number such as frame_%04d.png, or clip.mp4")
        outputs.check_paths(model, [(path, (".png",)) for path in self.written])

    def load(self, model: Path, name: str | None, clock: Clock, opaque: bool) -> tuple[um.Scene, um.Animation | None]:
        """The scene at second 0, and how it moves; None where only the camera does."""
        if name is not None or files.names_of_animations(model):
            animation = um.load_animation(model, name, clock, self.written)
            animation = replace(animation, scene=animation.scene.opaque()) if opaque else animation
            return animation.scene, animation
        if not self.orbit:
            raise OptionError(f"--frames: {model} has no animations, so nothing moves (--orbit: the camera)")
        return load(model, clock, self.written, opaque), None

    def stage(self, scene: um.Scene, animation: um.Animation | None, up: Vector) -> um.Scene:
        """The outermost of all that is seen in any frame, from all sides that it is seen from: one view for all."""
        reach = outermost(scene.positions) if animation is None else animation.outermost()
        middle, axis = (reach.min(axis=0) + reach.max(axis=0)) / 2, up_axis(np.array(up))
        turns = [turning(axis, 360.0 * i / _AROUND) for i in range(_AROUND if self.orbit else 1)]
        points = np.concatenate([middle + (reach - middle) @ turn.T for turn in turns]).astype(np.float32)
        rows = np.arange(len(points))
        return um.Scene(points, np.stack([rows, np.roll(rows, 1), np.roll(rows, 2)], axis=1), origin=scene.origin)

    def shoot(
        self,
        model: Path,
        scene: um.Scene,
        animation: um.Animation | None,
        shot: Shot,
        clock: Clock,
        as_json: bool,
    ) -> None:
        """Make what is not there yet, and say what there is."""
        duration, work = (0.0 if animation is None else animation.duration), Clock()
        common = {
            "umbrae": um.__version__,
            "model": hashlib.sha256(model.read_bytes()).hexdigest(),
            "animation": None if animation is None else animation.name,
            "opaque": all(material.casts_solid for material in scene.materials),
            "method": [shot.method.name, shot.method.options()],
            "lights": [vars(light) for light in shot.lights],
            "look": shot.look,
        }
        digests: dict[int, str] = {}
        caster: Caster | None = None
        kept = made = 0
        try:
            if self.is_clip:
                _make_folder(self.waiting)
            with clock.span("frames"):
                for number in self.frames.numbers:
                    clock.advance(len(digests), len(self.frames.numbers))
                    camera = self._camera(shot, number)
                    seconds = number / self.fps % duration if duration else 0.0
                    digests[number] = _digest({**common, "seconds": seconds, "camera": vars(camera)})
                    if files.load_image(self.picture(number), digests[number]) is not None:
                        kept += 1
                        continue
                    now = scene if animation is None else animation.at(seconds)
                    caster = caster or shot.method.prepare(now, work)
                    image = um.render(now, camera, shot.lights, shot.method, clock=work, caster=caster, **shot.look)
                    files.save_image(self.picture(number), image.pixels, digests[number])
                    made += 1
                    if made == 1 and image.samples is not None:
                        note_if_nothing_is_seen(image.samples)
            if self.is_clip:
                with clock.span("clip"):
                    files.save_clip(self.output, self._pictures(digests, clock), self.fps)
                self._clean()
        except (KeyboardInterrupt, typer.Abort):
            note(f"{kept + made} of {len(self.frames.numbers)} frames are there: the same command makes the others")
            raise
        if kept:
            note(f"{kept} of {len(digests)} frames were there already")
        if not as_json:
            for path in self.written:
                print(path)
            return
        print_json(
            model=str(model),
            triangles=len(scene.triangles),
            animation=common["animation"],
            duration=duration,
            frames=list(self.frames),
            fps=self.fps,
            orbit=self.orbit,
            made=made,
            kept=kept,
            size=[shot.camera.width, shot.camera.height],
            method=shot.method.name,
            options=shot.method.options(),
            origin=scene.origin.tolist(),
            seconds={**clock.seconds(), **work.seconds()},
            written=[str(path) for path in self.written],
        )

    def _camera(self, shot: Shot, number: int) -> um.Camera:
        if not self.orbit:
            return shot.camera
        middle = shot.stage.bounds.astype(np.float64).mean(axis=0)
        return shot.camera.turned(middle, shot.look["up"], self.orbit * number / self.fps)

    def _pictures(self, digests: Mapping[int, str], clock: Clock) -> Iterator[NDArray[np.uint8]]:
        for done, (number, digest) in enumerate(digests.items()):
            clock.advance(done, len(digests))
            pixels = files.load_image(self.picture(number), digest)
            if pixels is None:
                raise OutputError(f"{self.picture(number)}: was changed meanwhile; the same command makes it again")
            yield pixels

    def _clean(self) -> None:
        for path in (*self.waiting.glob("*.png"), *self.waiting.glob(".*.part")):
            path.unlink()
        with suppress(OSError):  # whoever has put something else there may keep it
            self.waiting.rmdir()


def film_of(
    frames: Frames | None,
    output: Path,
    fps: float | None,
    animation: str | None,
    orbit: float | None,
    others: Mapping[str, object],
) -> Film | None:
    """The film that the options ask for, None for a single picture; `others` are those that do not go with it."""
    if frames is None:
        for name, value in {"--fps": fps, "--animation": animation, "--orbit": orbit}.items():
            if value is not None:
                raise OptionError(f"{name} is that of --frames, which is not there")
        return None
    for name, other in others.items():
        if other is not None:
            raise OptionError(f"{name}: --frames makes pictures or a clip and nothing else")
    rate, turn = _FPS if fps is None else fps, orbit or 0.0
    if not 0.0 < rate <= _MOST_PER_SECOND:
        raise OptionError(f"--fps: wanted a number above 0, up to {_MOST_PER_SECOND}, got {rate}")
    if not math.isfinite(turn):
        raise OptionError(f"--orbit: wanted degrees per second, got {turn}")
    return Film(frames, output, rate, turn)


def _digest(made_of: Mapping[str, Any]) -> str:
    text = json.dumps(made_of, sort_keys=True, default=lambda value: np.asarray(value).tolist())
    return hashlib.sha256(text.encode()).hexdigest()
