"""A frame: what is done once, for each band of the samples, and for each batch of triangles."""

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.errors import InputError
from umbrae.geometry.chance import LIGHT, chances, key_of
from umbrae.geometry.solids import Solids, find_solids
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.gl.context import Session, session
from umbrae.gl.queries import stage
from umbrae.light import Light
from umbrae.mask import ShadowMask, add_stats
from umbrae.methods.frustum_gl.exact import decide_pairs, shares_of_pairs
from umbrae.methods.frustum_gl.layout import Part, View, parts_of, view_of
from umbrae.methods.frustum_gl.passes import GROUP, MOST_TASKS, PAIR_BYTES, Defines, Passes
from umbrae.methods.frustum_gl.uploaded import Band, GpuShadow, UploadedSamples
from umbrae.methods.method import Caster
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import EVEN, SOLID, VARYING, Transmission, transmission_of

BATCH = 1 << 17
"""Triangles whose frusta go down together: 25 MB of planes, and no dispatch that takes long."""
ROOM = 1 << 20
"""For tasks, and for pairs, to begin with."""
_UNSURE = 2


class FrustumGlCaster(Caster):
    """A scene's triangles on the GPU; `seed` that of stochastic transparency, None for the exact one."""

    def __init__(
        self,
        scene: Scene,
        silhouette_planes: bool,
        skip_full: bool,
        culling: bool,
        front_face_culling: bool,
        seed: int | None,
        clock: Clock | None,
    ) -> None:
        clock = clock or Clock()
        self.scene = scene
        self.session: Session = session()
        self.table = transmission_of(scene)
        self._outlines: Defines = {"SILHOUETTE_PLANES": 1} if silhouette_planes else {}
        self._skips: Defines = {"SKIP_FULL": 1} if skip_full else {}
        self._seed = None if self.table is None else seed
        self._key: np.uint64 | None = None
        self._culls_boxes, self._culls_faces = culling, front_face_culling
        self._batch, self._room = BATCH, ROOM
        with self.session.current() as current:
            self.passes = Passes(current, scene, self.table, self._seed is not None)
        self._holds = _holds(self.passes.groups, len(scene.triangles), self.table)
        self._measure(clock)

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        self.scene = scene
        with self.session.current():
            self.passes.move(scene.positions)
        self._measure(clock or Clock())

    def _measure(self, clock: Clock) -> None:
        """Find what depends on where the vertices are."""
        scene = self.scene
        self._reach = float(np.abs(scene.bounds).max())
        if self._culls_boxes:
            with self.session.current() as current, stage(current, clock, "bounds"):
                self.passes.bound()
        self._solids: Solids | None = None
        self._solid_of = None
        if self._culls_faces and len(scene.triangles):
            with clock.span("solids"):
                solid = np.ones(len(scene.triangles), bool) if self.table is None else self.table.kind == SOLID
                self._solids = find_solids(scene.positions, scene.triangles, solid)
            with self.session.current():
                self._solid_of = self.passes.buffer(self._solids.of)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        self.check(light, samples)
        return self.shadow_on_gpu(light, self.upload(samples, clock), clock).mask(clock)

    def upload(self, samples: ViewSamples, clock: Clock | None = None) -> UploadedSamples:
        """Samples in OpenGL buffers, for any number of lights.

        Raises
        ------
        InputError
            For samples of another scene, and for more of them in a pixel than chances can tell apart.
        GraphicsError
            For a picture of which the driver has no room for a row.
        """
        samples.check(self.scene)
        view = view_of(samples, self._reach)
        parts = parts_of(samples, self.passes.most) if len(self.scene.triangles) else ()
        with self.session.current() as current, stage(current, clock or Clock(), "upload"):
            bands = tuple(self.passes.upload(part, view.uniforms(self._reach)) for part in parts)
        return UploadedSamples(self, self.scene, samples, view, bands)

    def shadow_on_gpu(self, light: Light, uploaded: UploadedSamples, clock: Clock | None = None) -> GpuShadow:
        """The verdicts about samples that this caster has uploaded, left in OpenGL buffers."""
        if uploaded.caster is not self:
            raise InputError("frustum-gl: these samples were uploaded by another caster")
        if uploaded.scene is not self.scene:
            raise InputError("frustum-gl: these samples were uploaded before the scene was moved")
        clock = clock or Clock()
        names = "tile_frustum_tests", "sample_frustum_tests", "accepts", "rejects", "fallbacks", "predicate_fallbacks"
        stats = dict.fromkeys(names, 0)
        memory: dict[str, int] = {}
        merged = []
        self._met = np.full(self._holds.shape, not self._culls_boxes)
        if self._seed is not None:
            self._key = key_of(self._seed, LIGHT, light.position)
            self.passes.draw_by(self._key)
        with self.session.current() as current:
            if uploaded.bands:
                with stage(current, clock, "facing"):
                    self._face(light)
            for band in uploaded.bands:
                with stage(current, clock, "hierarchy"):
                    self.passes.build(band)
                add_stats(memory, self.passes.memory(band))
                pairs = self._cast(light, uploaded.view, band, False, stats, clock)
                if self.table is not None:
                    more = self._cast(light, uploaded.view, band, True, stats, clock)
                    pairs = np.concatenate([pairs, more, self._on_own_edges(self.table, band.part)])
                with clock.span("exact"):
                    found = self._decide(light, band.part, pairs)
                with stage(current, clock, "merge"):
                    merged.append(self.passes.merge(band, *found))
        partial = () if self.table is None else tuple(shares for _, shares in merged)
        return GpuShadow(
            self.session,
            uploaded,
            tuple(verdict for verdict, _ in merged),
            partial,
            self._key is not None,
            stats | {"culled": int(self._holds[~self._met].sum())} | memory,
        )

    def _face(self, light: Light) -> None:
        """The side of every triangle; exact arithmetic decides what float64 leaves open."""
        count, culling = len(self.scene.triangles), None
        if self._solids is not None:
            source = light.position.astype(np.float64)
            holds_light = ((source[:3] >= self._solids.lower) & (source[:3] <= self._solids.upper)).all(axis=1)
            culling = self._solid_of, np.asarray(~holds_light | light.is_directional)
        if self.passes.face(count, {"light": _source(light)}, culling):
            sides = self.passes.sides(count)
            unsure = np.flatnonzero(sides == _UNSURE)
            sides[unsure] = facing_of_all(self.scene.positions, self.scene.triangles[unsure], light.position)
            self.passes.set_sides(sides)

    def _cast(
        self, light: Light, view: View, band: Band, see_through: bool, stats: dict[str, int], clock: Clock
    ) -> NDArray[np.int32]:
        """Send the frusta down the tree, of the casters that let light through or of the others.

        Returns the pairs `(p, 2)` of a sample and a triangle that float64 leaves open.
        """
        uniforms = {
            **view.uniforms(self._reach), **band.part.tiles.uniforms, "light": _source(light), "reach": self._reach,
            "see_through": see_through,
        }  # fmt: skip
        through = self.passes.through if see_through else {}
        groups = np.flatnonzero(self._holds[int(see_through)]).astype(np.int32)
        if self._culls_boxes and len(groups):
            with stage(self.session, clock, "culling"):
                groups = groups[self.passes.cull(band, groups, uniforms)]
            self._met[int(see_through), groups] = True
        sent = self.passes.buffer(groups)
        start, count = 0, GROUP * len(groups)
        left: list[NDArray[np.int32]] = [np.zeros((0, 2), np.int32)]
        counted: list[dict[str, int]] = []
        while start < count:
            size = min(self._batch, count - start)
            with stage(self.session, clock, "setup"):
                self.passes.set_up(sent, size, {**uniforms, "first": start}, self._outlines)
            with stage(self.session, clock, "traversal"):
                self.passes.traverse(band, self._room, uniforms, {**self._outlines, **self._skips, **through})
            with stage(self.session, clock, "decide"):
                self.passes.decide(band, self._room, uniforms, through)
            tasks, queued, pairs, tests = self.passes.counted()
            if (wanted := max(tasks, queued)) > self._room:
                self._make_room(wanted, size)
                # From the beginning: what was let through must not count twice.
                start = 0
                left = left[:1]
                counted.clear()
                if see_through:
                    self.passes.let_all_through(band)
                continue
            start += size
            left.append(pairs)
            counted.append({**tests, "fallbacks": queued, "predicate_fallbacks": len(pairs)})
        for name in stats:
            stats[name] += sum(tests[name] for tests in counted)
        return np.concatenate(left)

    def _make_room(self, wanted: int, size: int) -> None:
        """For as many tasks or pairs as a batch of that size wants; a single triangle has no more than samples."""
        most = min(self.passes.most // PAIR_BYTES, MOST_TASKS)
        if wanted <= most:
            self._room = min(2 * wanted, most)
        else:
            self._room, self._batch = most, max(1, size // 2)

    def _decide(
        self, light: Light, part: Part, pairs: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """The samples of a band, `(n,)`, that exact arithmetic finds shadowed, and what arrives there, `(n, 3)`."""
        if not len(pairs):
            return np.zeros(0, np.int32), np.zeros((0, 3), np.float32)
        scene, source = self.scene, light.position.astype(np.float64)
        # Pairs name some samples several times, and few of all.
        asked, at = np.unique(pairs[:, 0].astype(np.intp), return_inverse=True)
        samples, where = part.samples.take(asked), np.stack([at.astype(np.int32), pairs[:, 1]], axis=1)
        closed, found = np.ones(len(pairs), bool), np.zeros(len(pairs), bool)
        if self.table is not None:
            closed = (self.table.kind == SOLID)[pairs[:, 1]] | self.table.closed[scene.material_id[pairs[:, 1]]]
        of = samples.triangle, samples.barycentric, samples.position
        decide_pairs(scene.positions, scene.triangles, source, *of, samples.side, where, closed, found)
        pairs, where, shares = pairs[found], where[found], np.zeros((int(found.sum()), 3))
        if self.table is not None:
            shares_of_pairs(scene.positions, scene.triangles, self.table, source, *of, where, shares)
        if self._key is not None:
            drawn = chances(self._key, pairs[:, 1].copy(), part.numbers(pairs[:, 0]), part.tiles.pixels[1])
            shares = np.where(drawn[:, None] < 1.0 - shares, 0.0, 1.0)
        shadowed, at = np.unique(pairs[:, 0], return_inverse=True)
        product = np.ones((len(shadowed), 3))
        np.multiply.at(product, at, shares)
        return shadowed, product.astype(np.float32)

    def _on_own_edges(self, table: Transmission, part: Part) -> NDArray[np.int32]:
        """The pairs `(p, 2)` of samples on an edge of their own triangle with it, where the edge may not be its own."""
        samples = part.samples
        own, (u, v) = samples.triangle.reshape(-1), samples.barycentric.reshape(-1, 2).T
        on_edge = (u == 0) | (v == 0) | (u.astype(np.float64) + v == 1)
        index = np.flatnonzero(samples.covered.reshape(-1) & (own >= 0) & on_edge)
        through = np.isin(table.kind, (EVEN, VARYING)) & ~table.closed[table.material_id]
        index = index[through[own[index]]]
        return np.stack([index, own[index]], axis=1).astype(np.int32)


def _holds(groups: int, count: int, table: Transmission | None) -> NDArray[np.int64]:
    """`(2, g)` how many of `count` triangles in each group are solid, and how many are not."""
    solid = np.ones(count, bool) if table is None else table.kind == SOLID
    group = np.arange(count) // GROUP
    return np.stack([np.bincount(group[one], minlength=groups) for one in (solid, ~solid)])


def _source(light: Light) -> tuple[float, ...]:
    return tuple(light.position.astype(np.float64).tolist())
