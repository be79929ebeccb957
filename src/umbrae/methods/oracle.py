"""The truth: exact rationals where floating point is unsure."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry import bvh
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.method import Caster, Method
from umbrae.methods.oracle_filter import decide_chunk, margin_chunk
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_CHUNK = 4096


@dataclass(frozen=True)
class Oracle(Method):
    """Every sample asks the triangles one by one; a floating-point filter first, rationals where it is unsure.

    The definition is the one of `geometry.predicates`, written a second time so that neither can hide the other's
    mistakes: determinants are formed around the sample instead of around a vertex (`oracle_filter`), and exact signs
    come from `fractions.Fraction`. A conservative box tree (`tree = True`) leaves out triangles that the segment from
    the sample to the light cannot meet; `tree = False` asks all of them.
    """

    tree: bool = True

    name: ClassVar[str] = "oracle"
    paper: ClassVar[str] = "the definition itself"
    guarantee: ClassVar[Guarantee] = Guarantee.EXACT

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "OracleCaster":
        return OracleCaster(scene, self.tree)


class OracleCaster(Caster):
    """A scene with its box tree."""

    def __init__(self, scene: Scene, tree: bool = True) -> None:
        self.scene = scene
        self.tree = bvh.build(scene.positions, scene.triangles)
        if not tree:
            self.tree.lower[:] = -np.inf
            self.tree.upper[:] = np.inf

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        samples.check(self.scene)
        clock = clock or Clock()
        flat = samples.take(np.flatnonzero(samples.covered.reshape(-1)))
        verdict = np.zeros(flat.size, np.int8)
        exact = Exact(self.scene, light)
        source = light.position.astype(np.float64)

        def task(chunk: int) -> list[NDArray[np.int64]]:
            start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, flat.size)
            room = 1 << 14
            while True:
                pairs = np.empty((room, 2), np.int64)
                found = decide_chunk(*self._arrays(), source, *_raw(flat), start, stop, verdict, pairs)
                if found <= room:
                    return [pairs[:found]]
                room = found

        with clock.span("oracle"):
            unsure = run(task, -(-flat.size // _CHUNK), clock) if len(self.scene.triangles) else []
        with clock.span("rationals"):
            asked = 0
            for chunk in unsure:
                for sample, triangle in chunk[0]:
                    if verdict[sample] == 0:
                        asked += 1
                        verdict[sample] = exact.shades(flat, int(sample), int(triangle))
        in_shadow = np.zeros(samples.size, bool)
        in_shadow[samples.covered.reshape(-1)] = verdict != 0
        return ShadowMask(in_shadow.reshape(samples.shape), Guarantee.EXACT, stats={"predicate_fallbacks": asked})

    def margin(
        self, light: Light, samples: ViewSamples, in_shadow: NDArray[np.bool_], clock: Clock | None = None
    ) -> NDArray[np.float32]:
        """`(...) float32` world units: a lower bound of how far each sample must move before its verdict changes.

        Lit samples: the distance to the nearest shadow frustum. Samples in shadow: the depth inside the frustum that
        holds them deepest. Never more than a hundredth of the scene's extent, where looking further is not worth it;
        so too for background and samples that their own triangle shades.
        """
        low, high = self.scene.bounds.astype(np.float64)
        cap = float(np.linalg.norm(high - low)) / 100.0
        margins = np.full(samples.size, cap)
        flat = samples.take(np.arange(samples.size))
        shaded = np.ascontiguousarray(in_shadow.reshape(-1))
        source = light.position.astype(np.float64)

        def task(chunk: int) -> None:
            start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, flat.size)
            margin_chunk(*self._arrays(), source, *_raw(flat), start, stop, flat.covered, shaded, margins)

        if len(self.scene.triangles):
            run(task, -(-flat.size // _CHUNK), clock)
        # One step down: rounding to float32, and in float64 before it, must not make a margin larger.
        rounded = np.nextafter(margins.astype(np.float32), np.float32(0))
        return rounded.reshape(samples.shape)

    def _arrays(self) -> tuple[Any, ...]:
        return (self.scene.positions, self.scene.triangles, *self.tree)


def _raw(samples: ViewSamples) -> tuple[Any, ...]:
    return samples.triangle, samples.barycentric, samples.side, samples.position


Vector = tuple[Fraction, Fraction, Fraction]


class Exact:
    """The definition in rational numbers, one sample and one triangle at a time."""

    def __init__(self, scene: Scene, light: Light) -> None:
        self.scene = scene
        *direction, self.w = (Fraction(float(x)) for x in light.position)
        self.light: Vector = (direction[0], direction[1], direction[2])

    def corners(self, triangle: int) -> tuple[Vector, Vector, Vector]:
        """The triangle's vertices."""
        a, b, c = (_vector(self.scene.positions[i]) for i in self.scene.triangles[triangle])
        return a, b, c

    def facing(self, triangle: int) -> int:
        """The side of the triangle's plane that the light is on; 0 in the plane, or no area."""
        a, b, c = self.corners(triangle)
        return _sign(_dot(_cross(_minus(b, a), _minus(c, a)), _minus(self.light, _times(self.w, a))))

    def shades(self, samples: ViewSamples, sample: int, triangle: int, closed: bool = True) -> bool:
        """Whether the triangle shadows sample number `sample` of a flat list.

        Side planes belong to the triangle if `closed`; else a sample on one counts as moved by (e, e**2, e**3), e -> 0.
        """
        own, side = int(samples.triangle[sample]), int(samples.side[sample])
        facing = self.facing(triangle)
        if triangle == own:
            return side * facing < 0
        if facing == 0:
            return False
        point, offset = _vector(samples.position[sample]), (Fraction(0), Fraction(0), Fraction(0))
        if own >= 0:
            u, v = (Fraction(float(x)) for x in samples.barycentric[sample])
            a, b, c = self.corners(own)
            ab, ac = _minus(b, a), _minus(c, a)
            point = _plus(a, _plus(_times(u, ab), _times(v, ac)))
            offset = _times(Fraction(side), _cross(ab, ac))

        def side_of(normal: Vector, base: Vector) -> int:
            return _sign(_dot(normal, _minus(point, base))) or _sign(_dot(normal, offset))

        a, b, c = self.corners(triangle)
        for first, second in ((a, b), (b, c), (c, a)):
            normal = _cross(_minus(_times(self.w, first), self.light), _minus(second, first))
            sign = side_of(normal, first)
            if sign == 0 and not closed:
                sign = next((_sign(component) for component in normal if component), 0)
            if -facing * sign < 0:
                return False
        return -facing * side_of(_cross(_minus(b, a), _minus(c, a)), a) > 0


def _vector(values: NDArray[np.float32]) -> Vector:
    x, y, z = (Fraction(float(value)) for value in values)
    return x, y, z


def _plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _times(factor: Fraction, a: Vector) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


def _dot(a: Vector, b: Vector) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _sign(value: Fraction) -> int:
    return (value > 0) - (value < 0)
