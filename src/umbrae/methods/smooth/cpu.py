"""Shadows with smooth boundaries of coarse meshes with smooth normals, counted exactly on the CPU."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.cluster_culling import choose_clusters
from umbrae.methods.frustum_cpu import BLOCK, MEMORY
from umbrae.methods.frustum_leaves import COUNTERS, Receivers
from umbrae.methods.frustum_tasks import in_parts, traverse
from umbrae.methods.frustum_traversal import merge
from umbrae.methods.lanes import LANES
from umbrae.methods.light_frame import POSITION_ERROR, light_frames, surface_error
from umbrae.methods.method import Caster, require_solid
from umbrae.methods.sample_tree import bounds_with, build, hierarchy_bytes
from umbrae.methods.smooth.cancelling import settle_doubts
from umbrae.methods.smooth.casting import Casting, casting_of
from umbrae.methods.smooth.crossing_count import CERTAIN, counting, write_counts
from umbrae.methods.smooth.silhouette import Silhouettes, SmoothMethod
from umbrae.methods.transmission_buffer import merge_sums, reserve
from umbrae.methods.triangle_clusters import TriangleClusters, cluster_triangles, moved_clusters
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_LEAVES_PER_TASK = 4096


@dataclass(frozen=True)
class Smooth(SmoothMethod):
    """Shadow boundaries that do not show the tessellation, after Mattausch, Scherzer, Wimmer and Igarashi 2012.

    A coarse mesh with smooth vertex normals casts the shadow of the smooth surface that it stands for. Its silhouette,
    found on the smooth normals (section 3.1), is bent into Hermite curves (3.2), cut into chords (3.3), and joined to
    the mesh by a band (4).

    The shadow volume is not drawn: for each sample the triangles between it and the light are counted, signed by the
    way they face it, with the exact predicate of all methods (`geometry.predicates`) in the hierarchy of `frustum`.

    Deviations from the paper: triangles are cut along the silhouette, and a sample on a cut triangle knows on which
    side of it it lies, so the offset of 0.15 along the negative normal is not needed. Curves are cut into as many
    chords as a bound of their second derivative asks for, instead of by halves; all points lie on one cubic. At
    creases a curve is perpendicular to the normals of both sides. Triangles are turned towards the light one by one,
    so meshes need not be closed, nor wound alike. Bands stand on the silhouette's ends only (`smooth_surface`).

    What it promises: nothing about the triangles' own shadow, which it changes on purpose. In connected parts without
    smooth normals, and with the discrete silhouette, verdicts are those of `frustum`.

    Options
    -------
    culling
        That of `frustum`.
    silhouette, epsilon, epsilon_px
        See `SmoothMethod`.
    """

    culling: bool = True

    name: ClassVar[str] = "smooth"
    paper: ClassVar[str] = "Mattausch, Scherzer, Wimmer, Igarashi 2012"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "SmoothCaster":
        return SmoothCaster(scene, self, clock)


class SmoothCaster(Caster):
    """The mesh with its edges, and its triangles in clusters; the silhouette is found anew for each light."""

    def __init__(self, scene: Scene, method: Smooth, clock: Clock | None) -> None:
        require_solid(scene, method.name)
        self.scene, self.method = scene, method
        self.silhouettes = Silhouettes(scene, method, clock)
        self.clusters = cluster_triangles(scene, clock)
        self._kept: tuple[Casting, TriangleClusters] | None = None

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        self.scene, self._kept = scene, None
        self.silhouettes.move(scene, clock)
        self.clusters = moved_clusters(self.clusters, scene, clock)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        self.check(light, samples)
        clock = clock or Clock()
        in_shadow = np.zeros(samples.size, bool)
        stats, memory = np.zeros(len(COUNTERS), np.int64), (0, 0)
        chosen = np.zeros(len(self.clusters.corners), bool)
        if not len(self.scene.triangles) or not samples.size:
            return ShadowMask(in_shadow.reshape(samples.shape), Guarantee.EXACT, stats={"culled": 0})
        with clock.span("contours"):
            casting, added = self._casting(light, samples, clock)
        width = samples.size // samples.shape[0]
        step = max(4, BLOCK // width // 4 * 4)
        for start in range(0, samples.shape[0], step):
            block = samples if step >= samples.shape[0] else samples.rows(start, start + step)
            part = slice(start * width, (start + step) * width)
            done, used = self._shadow_block(light, block, casting, added, chosen, in_shadow[part], clock)
            stats += done
            memory = max(memory[0], used[0]), max(memory[1], used[1])
        counters = dict(zip((*COUNTERS, *MEMORY), (*stats.tolist(), *memory), strict=True))
        counters["culled"] = self.clusters.triangles_in(~chosen)
        counters["contour_edges"] = int(casting.surface.chords.sum())
        guarantee = Guarantee.EXACT if casting.surface.is_the_soup else Guarantee.NONE
        return ShadowMask(in_shadow.reshape(samples.shape), guarantee, stats=counters)

    def _casting(self, light: Light, samples: ViewSamples, clock: Clock) -> tuple[Casting, TriangleClusters]:
        """The surface's soup, and clusters of what it has beside the scene's triangles; kept as long as the surface."""
        surface = self.silhouettes.surface(light, samples)
        if self._kept is None or self._kept[0].surface is not surface:
            casting = casting_of(self.silhouettes, surface, light)
            added = np.arange(len(self.scene.triangles), len(casting.soup.triangles))
            self._kept = casting, cluster_triangles(casting.soup, clock, added)
        return self._kept

    def _shadow_block(
        self,
        light: Light,
        samples: ViewSamples,
        casting: Casting,
        added: TriangleClusters,
        chosen: NDArray[np.bool_],
        in_shadow: NDArray[np.bool_],
        clock: Clock,
    ) -> tuple[NDArray[np.int64], tuple[int, int]]:
        """Decide the samples of one hierarchy; returns `COUNTERS` and `MEMORY`.

        Marks the `chosen (c,)` clusters of the mesh, which went down it.
        """
        surface, soup = casting.surface, casting.soup
        source = light.position.astype(np.float64)
        facing = surface.faces.facing
        count = len(facing)
        with clock.span("hierarchy"):
            bounds = bounds_with(soup.bounds.astype(np.float64), samples)
            largest = float(np.abs(bounds).max())
            # Pieces of triangles lie off them by a rounding of their new corners.
            error = 2 * POSITION_ERROR * largest + surface_error(bounds)
            frames = light_frames(source, bounds, error)
            away = self.silhouettes.turned_away(surface, samples) & samples.covered.reshape(-1)
            in_shadow |= away
            covered = samples.covered.reshape(-1) & ~away
            limits = error, 2.0**-50 * largest
            leaves, trees = build(samples, covered, np.zeros_like(facing), source, frames, limits, in_shadow, clock)
        raw = samples.barycentric.reshape(-1, 2), samples.side.reshape(-1), samples.position.reshape(-1, 3)
        receivers = Receivers(soup.positions, soup.triangles, source, *leaves[:3], *raw)
        active = [(frame, tree) for frame, tree in zip(frames, trees, strict=True) if tree is not None]
        used = [tree for _, tree in active]
        with clock.span("traversal"):
            solid = in_clusters(self.clusters, np.where(casting.core, facing, np.int8(0)))
            numbers = choose_clusters(self.clusters, source, active, self.method.culling, chosen, clock)
            stats = traverse(self.clusters, solid, active, numbers, receivers, None, clock)
        with clock.span("merge"):
            for tree in used:
                merge(tree.level, tree.full)
        with clock.span("counting"):
            whole, buffers = reserve(used, CERTAIN)
            dimming = [counting(casting.weight, casting.source, buffer) for buffer in buffers]
            cast = np.where(casting.weight != 0, casting.facing, np.int8(0))
            cast[:count][casting.core] = 0
            bands_too = np.zeros(len(added.corners), bool)
            for clusters, marks in ((self.clusters, chosen), (added, bands_too)):
                numbers = choose_clusters(clusters, source, active, self.method.culling, marks, clock)
                stats += traverse(clusters, in_clusters(clusters, cast), active, numbers, receivers, dimming, clock)
        doubt = np.zeros(samples.size, bool)
        with clock.span("merge"):
            for tree, buffer in zip(used, buffers, strict=True):
                merge_sums(tree.level, buffer)
                what = tree, receivers, buffer, facing, *casting.own, in_shadow, doubt
                in_parts(len(tree.slot), _LEAVES_PER_TASK, clock, write_counts, *what)
            settle_doubts(casting, light, samples, doubt, in_shadow)
        whole.release()
        leaves.release(sum(len(tree.slot) for tree in used))
        sums = sum(buffer.bytes for buffer in buffers)
        return stats, (hierarchy_bytes(leaves, used), sums + sum(tree.full.nbytes for tree in used))


def in_clusters(clusters: TriangleClusters, values: NDArray[np.int8]) -> NDArray[np.int8]:
    """`(c, 16)`: values `(t,)` of triangles in the clusters' order, 0 beyond the last."""
    arranged = np.zeros((len(clusters.corners), LANES), np.int8)
    arranged.reshape(-1)[: len(clusters.order)] = values[clusters.order]
    return arranged
