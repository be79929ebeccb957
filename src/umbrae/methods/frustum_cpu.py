"""Per-triangle shadow frusta, rasterized hierarchically over the view samples, on all CPU cores."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.chance import LIGHT, key_of
from umbrae.geometry.solids import Solids, find_solids
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.area_frustum import Casters, check_light_samples, shadow_of_area
from umbrae.methods.frustum_leaves import COUNTERS, Receivers
from umbrae.methods.frustum_tasks import empty_queue, in_parts, traverse
from umbrae.methods.frustum_transmission import Dimming
from umbrae.methods.frustum_traversal import merge, write_out
from umbrae.methods.light_frame import POSITION_ERROR, LightFrame, light_frames, surface_error
from umbrae.methods.lit_clusters import LitClusters
from umbrae.methods.method import Caster, Method, check_transparency
from umbrae.methods.sample_tree import SampleTree, bounds_with, build, hierarchy_bytes
from umbrae.methods.transmission_buffer import (
    TOLERANCE,
    Dice,
    leave_out,
    light_or_dark,
    merge_sums,
    reserve,
    terms,
    write_shares,
)
from umbrae.methods.triangle_clusters import TriangleClusters, cluster_triangles, moved_clusters
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import CLEAR, SOLID, Transmission, transmission_of

_ITSELF = np.empty(0, np.int32)
"""In place of `Dimming.source`."""

_LEAVES_PER_TASK = 4096

_SAMPLES_PER_TASK = 65536

MEMORY = ("hierarchy_bytes", "shadow_buffer_bytes")
"""In `ShadowMask.stats` beside `COUNTERS`: bytes of leaves and boxes, and of the flags and sums at nodes and samples.

Those of the largest block; a solid caster's verdict about a single sample takes the place of the sample's own triangle.
"""


BLOCK = 1 << 23
"""Samples per hierarchy: a 3840 x 2160 picture is one block; larger ones go band by band to bound the memory."""


@dataclass(frozen=True)
class Frustum(Method):
    """Exact shadows of any triangle soup after Sintorn, Olsson and Assarsson 2011, of solid and other casters.

    Every triangle's shadow frustum (its four planes: three through the light and an edge, and the triangle's own)
    descends a hierarchy of boxes over the view samples: a box outside is rejected, a box inside is accepted as a
    whole in the hierarchical shadow buffer, anything else is refined down to the samples (section 3.1). Tests are done
    in float32 with derived bounds; a sample that they leave open is decided by `geometry.predicates.shadows`, exactly.

    Triangles that let light through come second (section 3.2): the shadow buffer sums up the logarithms of what they
    let through, per colour channel; textures are looked up where the ray to the light meets the triangle, whose
    barycentrics are the distances from the side planes.

    Deviations from the paper: the hierarchy stands in the light's normalized device coordinates instead of the
    camera's (see `sample_tree`), where side planes are lines and a frustum's bounds in x and y do what the two
    silhouette planes towards the eye do there; frusta descend in clusters of 16 neighbours, and clusters in batches
    (see `frustum_traversal`); there is no bias,
    as a sample knows its own triangle; samples without a camera are served as well. Sums are of fixed point, so that
    threads cannot change them, and what is opaque is a flag beside them (see `transmission_buffer`); a shared edge of
    two panes counts once; large nodes within a textured triangle's shadow go onto a queue, as the paper wishes for.

    Options
    -------
    culling
        Leave out clusters of triangles whose box, and what lies below it in the light's view, meets no sample (see
        `cluster_culling`), before anything is computed about their triangles. It never changes a mask. Lights with a
        size do without.
    front_face_culling
        Leave half of each solid's triangles out (section 3.5): a ray that crosses a closed surface crosses triangles
        that face the light and triangles that face away in pairs. The paper drops the former, or the latter; here it
        is always those that face away from the light: on its way to a light outside, a ray from anywhere crosses at
        least as many of the others, also one that starts inside a solid or on it. That holds for parts whose winding
        number is nowhere negative (see `geometry.solids`); all others are never culled, nor are parts that are not
        opaque or whose bounding box holds the light. Off by default: finding the solids takes longer than it saves
        unless the same geometry is asked many times.
    transparency
        `exact` finds what share of light arrives; `stochastic` (section 3.2) one bit for each sample and channel, with
        the right probability: a ninth of the buffer, noise that the samples of a pixel average out, and no guarantee.
        Samples of a pixel are stratified after Enderton et al. 2010, which the paper proposes.
    seed
        Of `stochastic`: a whole number from 0.
    light_samples
        How many points of a light with a size each view sample looks at, 1 to 64: its shadow is a multiple of one over
        this number, exact for these points. They differ from sample to sample (see `area_samples`), and all are tested
        in one traversal with triangles' whole regions of influence (section 5; see `area_traversal`). Triangles that
        let light through dim each of them by what they let through on its way; `stochastic` stops it by chance.
    """

    culling: bool = True
    front_face_culling: bool = False
    transparency: str = "exact"
    seed: int = 0

    name: ClassVar[str] = "frustum"
    paper: ClassVar[str] = "Sintorn, Olsson, Assarsson 2011"
    guarantee: ClassVar[Guarantee] = Guarantee.EXACT
    accepts: ClassVar[tuple[str, ...]] = ("pictures", "points", "transparency", "area lights")

    def __post_init__(self) -> None:
        check_light_samples(self.light_samples)
        check_transparency(self.name, self.transparency, self.seed)

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "FrustumCaster":
        return FrustumCaster(scene, self, clock)


class _Sheer(NamedTuple):
    """Triangles that let some light through: what each material does, as sums take it, and clusters of them."""

    table: Transmission
    even: NDArray[np.int64]
    clusters: TriangleClusters


class _Lit(NamedTuple):
    """Clusters of solid and of sheer triangles under one light."""

    solid: LitClusters
    sheer: LitClusters | None

    @property
    def all(self) -> list[LitClusters]:
        return [self.solid] if self.sheer is None else [self.solid, self.sheer]


class FrustumCaster(Caster):
    """The triangles in clusters, and the solids if wanted; everything else depends on the light."""

    takes_area_lights = True

    def __init__(self, scene: Scene, method: Frustum, clock: Clock | None) -> None:
        self.scene = scene
        self.method = method
        self.sheer: _Sheer | None = None
        self.solid: NDArray[np.bool_] | None = None
        table = transmission_of(scene)
        if table is None:
            self.clusters = cluster_triangles(scene, clock)
            self.bounds = self.clusters.bounds
        else:
            self.solid = table.kind == SOLID
            self.clusters = cluster_triangles(scene, clock, np.flatnonzero(self.solid))
            self.bounds = scene.bounds.astype(np.float64)
            sheer = np.flatnonzero(table.kind > CLEAR)
            if len(sheer):
                self.sheer = _Sheer(table, terms(table.even), cluster_triangles(scene, clock, sheer))
        self.solids = self._find_solids()

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        self.scene = scene
        self.clusters = moved_clusters(self.clusters, scene, clock)
        self.bounds = self.clusters.bounds if self.solid is None else scene.bounds.astype(np.float64)
        if self.sheer is not None:
            self.sheer = self.sheer._replace(clusters=moved_clusters(self.sheer.clusters, scene, clock))
        self.solids = self._find_solids()

    def _find_solids(self) -> Solids | None:
        scene = self.scene
        if not self.method.front_face_culling or not len(scene.triangles):
            return None
        allowed = np.ones(len(scene.triangles), bool) if self.solid is None else self.solid
        return find_solids(scene.positions, scene.triangles, allowed)

    @property
    def casters(self) -> Casters:
        """The triangles as a light with a size wants them."""
        sheer = None if self.sheer is None else self.sheer.clusters
        return Casters(self.scene, self.bounds, self.clusters, self.solids, transmission_of(self.scene), sheer)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        self.check(light, samples)
        clock = clock or Clock()
        if light.is_area:
            seed = int(self.method.seed) if self.method.transparency == "stochastic" else None
            return shadow_of_area(self.casters, light, samples, self.method.light_samples, seed, clock)
        in_shadow = np.zeros(samples.size, bool)
        partial = None if self.sheer is None else np.empty((samples.size, 3), np.float32)
        stats, memory, culled = np.zeros(len(COUNTERS), np.int64), (0, 0), 0
        if len(self.scene.triangles) and samples.size:
            source = light.position.astype(np.float64)
            lit = self._lit(source, samples, clock)
            width = samples.size // samples.shape[0]
            step = max(4, BLOCK // width // 4 * 4)
            by_chance = self.method.transparency == "stochastic"
            key = key_of(self.method.seed, LIGHT, light.position) if by_chance else np.uint64(0)
            strata = samples.shape[2] if samples.camera is not None and len(samples.shape) == 3 else 1
            for start in range(0, samples.shape[0], step):
                block = samples if step >= samples.shape[0] else samples.rows(start, start + step)
                part = slice(start * width, (start + step) * width)
                dice = Dice(strata if by_chance else 0, key, start * width)
                shares = None if partial is None else partial[part]
                done, used = self._shadow_block(source, block, lit, dice, in_shadow[part], shares, clock)
                stats += done
                # One block after the other, in the same memory.
                memory = max(memory[0], used[0]), max(memory[1], used[1])
            culled = sum(one.culled for one in lit.all)
        counters = dict(zip((*COUNTERS, *MEMORY), (*stats.tolist(), *memory), strict=True)) | {"culled": culled}
        in_shadow = in_shadow.reshape(samples.shape)
        if partial is None:
            return ShadowMask(in_shadow, Guarantee.EXACT, stats=counters)
        partial = partial.reshape(*samples.shape, 3)
        if self.method.transparency == "stochastic":
            return ShadowMask(in_shadow, Guarantee.NONE, stats=counters, partial=partial)
        return ShadowMask(in_shadow, Guarantee.EXACT, stats=counters, partial=partial, tolerance=TOLERANCE)

    def _lit(self, source: NDArray[np.float64], samples: ViewSamples, clock: Clock) -> _Lit:
        """All clusters under a light `(4,)`, with the sides of those that samples lie on."""
        own = np.zeros(len(self.scene.triangles), np.int8)
        solid = LitClusters(self.scene, self.clusters, source, own)
        sheer = None if self.sheer is None else LitClusters(self.scene, self.sheer.clusters, source, own)
        lit = _Lit(solid, sheer)
        with clock.span("facing"):
            for one in lit.all:
                if self.method.culling:
                    one.find_seen(samples.triangle.reshape(-1), clock)
                else:
                    one.find(np.ones(len(one.sides), bool), clock)
        return lit

    def _shadow_block(
        self,
        source: NDArray[np.float64],
        samples: ViewSamples,
        lit: _Lit,
        dice: Dice,
        in_shadow: NDArray[np.bool_],
        partial: NDArray[np.float32] | None,
        clock: Clock,
    ) -> tuple[NDArray[np.int64], tuple[int, int]]:
        """Decide the samples of one hierarchy; returns `COUNTERS` and `MEMORY`."""
        with clock.span("hierarchy"):
            bounds = bounds_with(self.bounds, samples)
            largest = float(np.abs(bounds).max())
            on_surface = samples.camera is not None or bool((samples.triangle >= 0).any())
            error = POSITION_ERROR * largest + surface_error(bounds) if on_surface else 0.0
            frames = light_frames(source, bounds, error)
            limits = error, 2.0**-50 * largest
            own = lit.solid.own
            shading = own if self.solid is None else np.where(self.solid, own, np.int8(0))
            covered = samples.covered.reshape(-1)
            if self.sheer is not None:
                covered = self._not_behind_own(self.sheer.table, source, samples, own, in_shadow, clock)
            leaves, trees = build(samples, covered, shading, source, frames, limits, in_shadow, clock)
        raw = samples.barycentric.reshape(-1, 2), samples.side.reshape(-1), samples.position.reshape(-1, 3)
        receivers = Receivers(self.scene.positions, self.scene.triangles, source, *leaves[:3], *raw)
        active = [(frame, tree) for frame, tree in zip(frames, trees, strict=True) if tree is not None]
        with clock.span("culling"):
            chosen = lit.solid.choose(active, self.method.culling, clock)
            if self.solids is not None:
                self._cull(self.solids, source, lit.solid.sides)
        with clock.span("traversal"):
            stats = traverse(self.clusters, lit.solid.sides, active, chosen, receivers, None, clock)
        with clock.span("merge"):
            for _, tree in active:
                merge(tree.level, tree.full)
                if partial is None:
                    verdicts = tree.slot, tree.full, leaves.ids, in_shadow
                    in_parts(len(tree.slot), _LEAVES_PER_TASK, clock, write_out, *verdicts)
        used = [tree for _, tree in active]
        flags, sums = sum(tree.full.nbytes for tree in used), 0
        if self.sheer is not None and lit.sheer is not None and partial is not None:
            dimmed, sums = self._dim(self.sheer, lit.sheer, dice, active, receivers, in_shadow, partial, clock)
            stats += dimmed
        leaves.release(sum(len(tree.slot) for tree in used))
        return stats, (hierarchy_bytes(leaves, used), flags + sums)

    def _dim(
        self,
        sheer: _Sheer,
        lit: LitClusters,
        dice: Dice,
        active: list[tuple[LightFrame, SampleTree]],
        receivers: Receivers,
        in_shadow: NDArray[np.bool_],
        partial: NDArray[np.float32],
        clock: Clock,
    ) -> tuple[NDArray[np.int64], int]:
        """Let the other triangles dim what the solid ones have left lit, and write what arrives into `partial`.

        Returns `COUNTERS` and the bytes of the transmission buffers.
        """
        with clock.span("transmission"):
            in_parts(len(partial), _SAMPLES_PER_TASK, clock, light_or_dark, in_shadow, partial)
            whole, buffers = reserve([tree for _, tree in active], dice)
            dimming = [Dimming(sheer.table, sheer.even, buffer, dice, *empty_queue(0), _ITSELF) for buffer in buffers]
            chosen = lit.choose(active, self.method.culling, clock)
            stats = traverse(sheer.clusters, lit.sides, active, chosen, receivers, dimming, clock)
        with clock.span("merge"):
            for (_, tree), buffer in zip(active, buffers, strict=True):
                if dice.strata == 0:
                    merge_sums(tree.level, buffer)
                what = tree, receivers, lit.own, sheer.table, buffer, dice, in_shadow, partial
                in_parts(len(tree.slot), _LEAVES_PER_TASK, clock, write_shares, *what)
        whole.release()
        return stats, sum(buffer.bytes for buffer in buffers)

    def _not_behind_own(
        self,
        table: Transmission,
        source: NDArray[np.float64],
        samples: ViewSamples,
        facing: NDArray[np.int8],
        in_shadow: NDArray[np.bool_],
        clock: Clock,
    ) -> NDArray[np.bool_]:
        """`covered (n,)` without samples whose own triangle is turned away and opaque there; sets those `in_shadow`."""
        covered = samples.covered.reshape(-1).copy()
        raw = samples.triangle.reshape(-1), samples.barycentric.reshape(-1, 2), samples.side.reshape(-1)
        what = self.scene.positions, self.scene.triangles, source, *raw, facing, table, covered, in_shadow
        in_parts(samples.size, _SAMPLES_PER_TASK, clock, leave_out, *what)
        return covered

    def _cull(self, solids: Solids, source: NDArray[np.float64], clustered: NDArray[np.int8]) -> None:
        """Let the triangles of solids that face away from the light cast nothing."""
        holds_light = ((source[:3] >= solids.lower) & (source[:3] <= solids.upper)).all(axis=1)
        culled = np.append(~holds_light | (source[3] == 0.0), False)[solids.of][self.clusters.order]
        sides = clustered.reshape(-1)[: len(culled)]
        sides[culled & (sides < 0)] = 0
