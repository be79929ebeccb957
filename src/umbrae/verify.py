"""A mask held against the truth."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import instance, number, whole
from umbrae.clock import Clock
from umbrae.errors import InputError
from umbrae.geometry.volume_faces import face_distance, facing_of_all
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.method import LIGHT_SAMPLES
from umbrae.methods.oracle import Oracle, OracleCaster
from umbrae.samples import ViewSamples, surface_points
from umbrae.scene import Scene

_NEARLY_EDGE_ON = 1e-3
"""Radians between the own triangle's plane and the light; only the naming of mismatches depends on it."""

_MOST_TOLERANCE = 1e-3
"""No mask may ask for more: a quarter of a step of 8 bits, which no picture shows."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """How a mask compares with the oracle.

    Attributes
    ----------
    checked
        Number of samples compared.
    mismatches
        How many differ, inside the band or outside: in whether any light arrives, or in the share that does, in any
        colour channel, by more than the mask's tolerance.
    outside_band, inside_band
        The two parts of `mismatches`. A mask whose guarantee is not `BANDED` has all of them outside.
    wrong
        `(n,)` flat indices of the mismatches.
    margin
        `(n,)` float32 world units: how far each of them lies at least from where a mistake could be forgiven. For a
        `BANDED` mask that is the nearest face of any shadow volume, the cap of the own triangle left out: counts go
        wrong there also where the verdict does not change. It is what the band is compared with; the largest float32
        in a scene without a face. For any other mask it is the nearest change of verdict; under a light with a size,
        of any of its light samples.
    classes
        How many mismatches are of which kind, for a `BANDED` mask; empty for any other. "facing away": the own
        triangle is edge-on to the light, within a thousandth of a radian, or it shades the sample itself while the
        mask says lit. "boundary": all others.
    worst_transmittance
        The most by which the share of light is off in any channel, over all samples compared; 0 where each of them is
        lit or dark.
    """

    checked: int
    mismatches: int
    outside_band: int
    inside_band: int
    wrong: NDArray[np.intp]
    margin: NDArray[np.float32]
    classes: Mapping[str, int] = field(default_factory=dict)
    worst_transmittance: float = 0.0

    @property
    def ok(self) -> bool:
        """Whether nothing differs outside the band."""
        return self.outside_band == 0

    @property
    def worst_margin(self) -> float:
        """The largest margin of a mismatch in world units, inside its band or outside; 0 without any."""
        return float(self.margin.max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Truth:
    """What the oracle says of some samples: found once, any number of masks are held against it.

    Attributes
    ----------
    chosen
        `(n,)` flat indices of the samples that were asked about, ascending.
    in_shadow
        `(n,) bool` the oracle's verdicts.
    transmittance
        `(n, 3) float32` the share of light that arrives per colour channel; None where all casters are solid and the
        light has no size.
    lowest, highest
        `(n, 3) float32` between what it lies, as far as float64 can tell (`methods.oracle.Decided`); all that lies
        between is right. None as above.
    """

    scene: Scene
    light: Light
    samples: ViewSamples
    chosen: NDArray[np.intp]
    in_shadow: NDArray[np.bool_]
    caster: OracleCaster
    transmittance: NDArray[np.float32] | None = None
    lowest: NDArray[np.float32] | None = None
    highest: NDArray[np.float32] | None = None

    @classmethod
    def find(
        cls,
        scene: Scene,
        light: Light,
        samples: ViewSamples,
        count: int | None = None,
        seed: int = 0,
        clock: Clock | None = None,
        light_samples: int = LIGHT_SAMPLES,
    ) -> "Truth":
        """Ask the oracle; parameters and errors are those of `verify`."""
        for value, kind, name in ((scene, Scene, "scene"), (light, Light, "light"), (samples, ViewSamples, "samples")):
            instance(value, kind, f"verify: {name}")
        samples.check(scene)
        if whole(seed, "verify: seed") < 0:
            raise InputError(f"verify: wanted a seed of at least 0, got {seed}")
        if count is not None and whole(count, "verify: count") < 1:
            raise InputError(f"verify: wanted a count of at least 1, got {count}")
        chosen = np.flatnonzero(samples.covered.reshape(-1))
        if count is not None and count < len(chosen):
            chosen = np.sort(np.random.default_rng(seed).choice(chosen, count, replace=False))
        caster = Oracle(light_samples=light_samples).prepare(scene)
        mask, lowest, highest = caster.decide_at(light, samples, chosen, clock)
        return cls(scene, light, samples, chosen, mask.in_shadow, caster, mask.partial, lowest, highest)

    def judge(self, mask: ShadowMask) -> Verdict:
        """Compare a mask of these samples with the truth."""
        band = _checked_band(mask, self.samples)
        if band is not None and self.light.is_area:
            raise InputError("verify: wanted a light without a size for a BANDED mask")
        differs, worst = self._compare(mask)
        differ = np.flatnonzero(differs)
        wrong = self.chosen[differ]
        if band is None:
            margin = self.caster.margin_at(self.light, self.samples, wrong, self.in_shadow[differ])
            return Verdict(len(self.chosen), len(wrong), len(wrong), 0, wrong, margin, {}, worst)
        mistaken = self.samples.take(wrong)
        margin = _distance_to_faces(self.scene, self.light, mistaken, mask.inner_faces)
        inside = int((margin <= band.reshape(-1)[wrong]).sum())
        classes = _classes(self.scene, self.light, mistaken)
        return Verdict(len(self.chosen), len(wrong), len(wrong) - inside, inside, wrong, margin, classes, worst)

    def _compare(self, mask: ShadowMask) -> tuple[NDArray[np.bool_], float]:
        """`(n,)` where a mask is wrong, and by how much light at most."""
        in_shadow = mask.in_shadow.reshape(-1)[self.chosen]
        if self.lowest is None or self.highest is None:
            differs = in_shadow != self.in_shadow
            if mask.partial is None:
                return differs, 0.0
            lowest = highest = np.where(self.in_shadow, np.float32(0), np.float32(1))[:, None]
        else:
            lowest, highest = self.lowest, self.highest
            # Either is right where float64 cannot tell a trace of light from none.
            differs = np.where(in_shadow, (lowest > 0).any(axis=1), (highest == 0).all(axis=1))
        found = mask.transmittance.reshape(-1, 3)[self.chosen].astype(np.float64)
        off = np.maximum(np.maximum(lowest - found, found - highest), 0.0).max(axis=1)
        return differs | (off > mask.tolerance), float(off.max(initial=0.0))


def verify(
    scene: Scene,
    light: Light,
    samples: ViewSamples,
    mask: ShadowMask,
    count: int | None = None,
    seed: int = 0,
    clock: Clock | None = None,
    light_samples: int = LIGHT_SAMPLES,
) -> Verdict:
    """Compare a mask with the oracle.

    Parameters
    ----------
    count
        How many covered samples to draw at random (without repetition); all of them when None or too large.
    seed
        Of the draw.
    light_samples
        How many points of a light with a size the mask was made with; the same ones are asked about.

    Raises
    ------
    InputError
        If mask or band and samples differ in shape, the mask holds shares of light outside [0, 1] or asks for a
        tolerance above a thousandth, the samples were made for another scene, or `count` is not positive.
    """
    # Before the work, not after it.
    instance(samples, ViewSamples, "verify: samples")
    _checked_band(mask, samples)
    return Truth.find(scene, light, samples, count, seed, clock, light_samples).judge(mask)


def _checked_band(mask: ShadowMask, samples: ViewSamples) -> NDArray[np.float32] | None:
    """The band of a `BANDED` mask of these samples, which must have one; None for any other."""
    instance(mask, ShadowMask, "verify: mask")
    if mask.in_shadow.shape != samples.shape:
        raise InputError(f"verify: mask has shape {mask.in_shadow.shape}, samples have {samples.shape}")
    if not 0.0 <= number(mask.tolerance, "verify: mask.tolerance") <= _MOST_TOLERANCE:
        raise InputError(f"verify: mask.tolerance: wanted a number in [0, {_MOST_TOLERANCE}], got {mask.tolerance}")
    if mask.partial is not None:
        instance(mask.partial, np.ndarray, "verify: mask.partial")
        wanted = (*samples.shape, 3)
        if mask.partial.shape != wanted or mask.partial.dtype != np.float32:
            got = f"{mask.partial.shape} {mask.partial.dtype}"
            raise InputError(f"verify: mask.partial: wanted {wanted} float32, got {got}")
        if not ((mask.partial >= 0) & (mask.partial <= 1)).all():
            low, high = float(mask.partial.min()), float(mask.partial.max())
            raise InputError(f"verify: mask.partial: wanted numbers in [0, 1], got {low:g} to {high:g}")
    if mask.guarantee is not Guarantee.BANDED:
        return None
    if not isinstance(mask.band, np.ndarray):
        raise InputError(f"verify: mask.band: wanted an array for a BANDED mask, got {type(mask.band).__name__}")
    shape = mask.in_shadow.shape
    if mask.band.shape != shape or mask.band.dtype != np.float32:
        raise InputError(f"verify: mask.band: wanted {shape} float32, got {mask.band.shape} {mask.band.dtype}")
    return mask.band


def _distance_to_faces(scene: Scene, light: Light, samples: ViewSamples, inner: bool) -> NDArray[np.float32]:
    """`(n,)` lower bounds of the distance of each sample of a list to the nearest face of a volume but its own cap."""
    own = samples.triangle >= 0
    points, slack = samples.position.astype(np.float64), np.zeros(samples.size)
    triangle = samples.triangle[own]
    points[own] = surface_points(scene, triangle, samples.barycentric[own])
    # At most 12 roundings along each axis of numbers no larger than the triangle's coordinates; 12 sqrt(3) < 32.
    slack[own] = 2.0**-48 * np.abs(scene.positions[scene.triangles[triangle]]).max(axis=(1, 2), initial=0)
    distance = face_distance(scene.positions, scene.triangles, light.position, points, samples.triangle, inner)
    # One step down: rounding to float32 must not make it larger.
    return np.nextafter(np.maximum(distance - slack, 0).astype(np.float32), np.float32(0))


def _classes(scene: Scene, light: Light, samples: ViewSamples) -> dict[str, int]:
    """Number of mismatches by class. Samples that ignore their own triangle, or have none, are on a boundary."""
    own = np.flatnonzero((samples.triangle >= 0) & (samples.side != 0))
    triangle, side = samples.triangle[own], samples.side[own]
    facing = facing_of_all(scene.positions, scene.triangles, light.position)[triangle]
    a, b, c = np.moveaxis(scene.positions[scene.triangles[triangle]].astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    source, w = light.position[:3].astype(np.float64), float(light.position[3])
    to_light = source - w * surface_points(scene, triangle, samples.barycentric[own])
    sine = np.abs((normal * to_light).sum(axis=1))
    edge_on = sine <= _NEARLY_EDGE_ON * np.linalg.norm(normal, axis=1) * np.linalg.norm(to_light, axis=1)
    # Where the own triangle shades the sample the truth is "in shadow", so that a mismatch means: the mask says lit.
    facing_away = int((edge_on | (facing * side < 0)).sum())
    return {"boundary": samples.size - facing_away, "facing away": facing_away}
