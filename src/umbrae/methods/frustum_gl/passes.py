"""The passes of a frame: each a shader, its buffers and its uniforms."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import GraphicsError
from umbrae.gl.compute import clear, dispatch, groups_of
from umbrae.gl.context import Session
from umbrae.methods.frustum_gl.layout import Part
from umbrae.methods.frustum_gl.materials import material_arrays
from umbrae.methods.frustum_gl.pack import with_packed
from umbrae.methods.frustum_gl.tiles import BRANCH, Tiles
from umbrae.methods.frustum_gl.uploaded import Band
from umbrae.scene import Scene
from umbrae.transmission import Transmission

HERE = Path(__file__).parent
POSITIONS, TRIANGLES, FACING, SAMPLES, NUMBERS = range(5)
PLACES, BOXES, PRESENT, DARK, FRUSTA, COUNTERS, TASKS, QUEUE, UNSURE, VERDICT = range(6, 16)
DIMMED, PARTIAL = 21, 22
"""Where the shaders find their buffers. In DIMMED is what casters let through: sums, or bits where chance decides."""
SOLIDS, CULLED, FOUND, SHARES = QUEUE, UNSURE, QUEUE, UNSURE
BOUNDS, GROUPS, MET = FRUSTA, QUEUE, UNSURE
"""Where those find others that use neither of these."""

GROUP = 128
"""Triangles that are culled together. More of them have wider boxes, and fewer would cost more than they save."""
_BOUNDS_BYTES = 6 * 4
FRUSTUM_BYTES = 12 * 16
PAIR_BYTES = 8
_DECIDERS = 512
"""Groups of 64 that take pairs in turns."""
_COUNTERS = 18
_FRUSTA_MADE, _TASKS_MADE, _QUEUED, _UNDECIDED, _FRUSTA_GROUPS, _TASKS_GROUPS = 0, 1, 2, 3, 12, 15
"""Counters, as in `frustum.glsl`; the last two are of three numbers each, for an indirect dispatch."""
_TESTS = {"tile_frustum_tests": 4, "sample_frustum_tests": 6, "accepts": 8, "rejects": 10}
"""Counters of 64 bits."""
_GROUPS_X = 256
MOST_TASKS = _GROUPS_X * 65535
"""As many as an indirect dispatch in rows of that length has groups, on every driver."""

Defines = dict[str, int | str]


class Passes:
    """What runs on the GPU for one scene, with the buffers that are kept from frame to frame.

    Parameters
    ----------
    session
        The OpenGL context, which must be current whenever a pass runs.
    scene, table
        The triangles, and what they let through; None when all are solid.
    by_chance
        Whether chances decide what is let through (`geometry.chance`); `draw_by` then says which.

    Raises
    ------
    GraphicsError
        When the driver has no room for them.
    """

    def __init__(self, session: Session, scene: Scene, table: Transmission | None, by_chance: bool) -> None:
        self.session = session
        self.most = session.integer("GL_MAX_SHADER_STORAGE_BLOCK_SIZE")
        arrays: dict[int, NDArray[Any]] = {POSITIONS: scene.positions, TRIANGLES: scene.triangles}
        if table is not None:
            arrays |= material_arrays(table)
        for array in arrays.values():
            if array.nbytes > self.most:
                raise GraphicsError(
                    f"frustum-gl: an array of this scene has {array.nbytes} bytes, and one buffer of this OpenGL "
                    f"driver takes {self.most}; the method `frustum` needs no buffers"
                )
        self._scene = {binding: self.buffer(array) for binding, array in arrays.items()}
        self._materials: Defines = {} if table is None else {"MATERIALS": 1}
        self._key: tuple[int, int] | None = None
        self._by_chance: Defines = {"BY_CHANCE": 1} if by_chance else {}
        self._colored = table is not None and len(table.colors) > 0
        self._kept: dict[int, Any] = {}
        self._total = len(scene.triangles)
        self._bounds = self.reserve(_BOUNDS_BYTES * self.groups)

    @property
    def groups(self) -> int:
        """How many groups of triangles that follow each other there are."""
        return -(-self._total // GROUP)

    def move(self, positions: NDArray[np.float32]) -> None:
        """Let the scene's vertices be at `positions (v, 3)`."""
        if positions.size:
            self._scene[POSITIONS].write(positions.tobytes())

    def bound(self) -> None:
        """Find the boxes around groups of triangles, which `cull` wants."""
        if self.groups:
            uniforms = {"total": self._total, "count": self.groups}
            self._run("bounds", groups_of(self.groups), uniforms, {BOUNDS: self._bounds}, {"GROUP": GROUP})

    def draw_by(self, key: np.uint64) -> None:
        """Take the chances of a key from now on."""
        self._key = int(key) & 0xFFFFFFFF, int(key) >> 32

    def buffer(self, values: NDArray[Any]) -> Any:
        """A buffer with these values; never empty, which OpenGL does not allow."""
        return self.session.moderngl.buffer(np.ascontiguousarray(values).tobytes() or bytes(4))

    def reserve(self, size: int) -> Any:
        """A buffer of that many bytes, whatever they are."""
        return self.session.moderngl.buffer(reserve=max(size, 4))

    def upload(self, part: Part, view: Mapping[str, Any]) -> Band:
        """Samples in buffers, and their places as `view` has them."""
        numbers = None
        if self._by_chance:
            numbers = self.buffer(part.numbers(np.arange(part.samples.size, dtype=np.int32)).astype(np.uint32))
        given = with_packed(part.samples, self.session.moderngl.buffer)
        made = Band(part, given, self.reserve(16 * part.tiles.places), numbers)
        uniforms = {**view, **part.tiles.uniforms, "count": part.tiles.places}
        buffers = {SAMPLES: made.given, PLACES: made.places}
        self._run("place", groups_of(part.tiles.places), uniforms, buffers)
        return made

    def face(self, count: int, uniforms: Mapping[str, Any], culling: tuple[Any, NDArray[np.bool_]] | None) -> int:
        """Find the sides of all triangles that the light is on; returns how many of them float64 leaves open.

        `culling`: a buffer with the solid each triangle belongs to, and which solids' back faces are left out.
        """
        buffers = {FACING: self._room(FACING, 4 * count), COUNTERS: self._counters()}
        defines: Defines = {}
        if culling is not None:
            buffers |= {SOLIDS: culling[0], CULLED: self.buffer(culling[1].astype(np.uint32))}
            defines = {"CULL": 1}
        self._run("facing", groups_of(count), {**uniforms, "count": count}, buffers, defines)
        return int(self._count()[_UNDECIDED])

    def sides(self, count: int) -> NDArray[np.int32]:
        """What `face` has found, `(t,)`."""
        return np.frombuffer(self._kept[FACING].read(4 * count), np.int32).copy()

    def set_sides(self, sides: NDArray[np.int32]) -> None:
        """Replace what `face` has found."""
        self._kept[FACING].write(sides.tobytes())

    def build(self, band: Band) -> None:
        """Build the tree, from the leaves up, with no shadow in it."""
        tiles = band.part.tiles
        buffers = {
            **self._some(FACING),
            SAMPLES: band.given,
            PLACES: band.places,
            BOXES: self._room(BOXES, 32 * tiles.nodes),
            PRESENT: self._room(PRESENT, 4 * tiles.words),
        }
        for level in range(1, tiles.depth + 1):
            leaves: Defines = {"LEAVES": 1, **self._materials} if level == 1 else {}
            self._run("hierarchy", groups_of(tiles.count(level)), {**tiles.uniforms, "level": level}, buffers, leaves)
        clear(self.session, self._room(DARK, 4 * tiles.words))
        self.let_all_through(band)

    def let_all_through(self, band: Band) -> None:
        """No caster has dimmed any light yet."""
        if dimmed := self._dimmed_bytes(band):
            clear(self.session, self._room(DIMMED, dimmed))

    def memory(self, band: Band) -> dict[str, int]:
        """Bytes of the samples, of the hierarchy above them, and of the shadow buffer, as far as `band` fills them."""
        tiles = band.part.tiles
        return {
            "samples_bytes": sum(one.size for one in (band.given, band.places, band.numbers) if one is not None),
            "hierarchy_bytes": 32 * tiles.nodes + 4 * tiles.words,
            "shadow_buffer_bytes": 4 * tiles.words + self._dimmed_bytes(band),
        }

    def tree(self, tiles: Tiles) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """What `build` has found: `(nodes, 2, 4)` lowest and highest x, y, q; `(words,)` which children there are."""
        boxes = np.frombuffer(self._kept[BOXES].read(32 * tiles.nodes), np.float32)
        return boxes.reshape(-1, 2, 4), np.frombuffer(self._kept[PRESENT].read(4 * tiles.words), np.uint32)

    def places(self, band: Band) -> NDArray[np.uint32]:
        """What `place` has found, `(places, 4)`: the bits of x, y, q, and the own triangle."""
        return np.frombuffer(band.places.read(), np.uint32).reshape(-1, 4)

    def frusta(self) -> NDArray[np.uint32]:
        """What `set_up` has made last, `(n, 48)`: see `frustum.glsl`."""
        count = int(self._count()[_FRUSTA_MADE])
        return np.frombuffer(self._kept[FRUSTA].read(FRUSTUM_BYTES * count), np.uint32).reshape(count, -1)

    def cull(self, band: Band, groups: NDArray[np.int32], uniforms: Mapping[str, Any]) -> NDArray[np.bool_]:
        """Which of the `groups (n,)` of triangles may shade a sample that is not dark."""
        made = self._room(MET, 4 * len(groups))
        buffers = {
            **self._some(BOXES, PRESENT, DARK),
            PLACES: band.places,
            BOUNDS: self._bounds,
            GROUPS: self.buffer(groups),
            MET: made,
        }
        self._run("cull", len(groups), {**uniforms, "count": len(groups)}, buffers)
        met: NDArray[np.bool_] = np.frombuffer(made.read(4 * len(groups)), np.uint32) != 0
        return met

    def set_up(self, groups: Any, count: int, uniforms: Mapping[str, Any], defines: Defines) -> None:
        """Make the frusta of those of `count` triangles that let light through, or do not.

        They stand in `groups`, a buffer of numbers of groups, from the triangle `first` in these. `first` and
        `see_through` are among the uniforms.
        """
        counters = np.zeros(_COUNTERS, np.uint32)
        counters[[_FRUSTA_GROUPS, _TASKS_GROUPS]] = _GROUPS_X
        counters[[_FRUSTA_GROUPS + 2, _TASKS_GROUPS + 2]] = 1
        self._room(COUNTERS, counters.nbytes).write(counters.tobytes())
        frusta = self._room(FRUSTA, FRUSTUM_BYTES * count)
        buffers = {**self._some(FACING, BOXES, COUNTERS), FRUSTA: frusta, GROUPS: groups}
        given: Defines = {**defines, **self._materials, **self._by_chance, "GROUP": GROUP}
        self._run("setup", groups_of(count), {**uniforms, "count": count, "total": self._total}, buffers, given)

    def traverse(self, band: Band, room: int, uniforms: Mapping[str, Any], defines: Defines) -> None:
        """Send the frusta down the tree."""
        counters = self._kept[COUNTERS]
        buffers = {
            **self._some(BOXES, PRESENT, DARK, FRUSTA, COUNTERS),
            PLACES: band.places,
            TASKS: self._room(TASKS, PAIR_BYTES * room),
            QUEUE: self._room(QUEUE, PAIR_BYTES * room),
            **self._dimmed(band),
        }
        given = {**uniforms, "room": room}
        if band.part.tiles.depth <= BRANCH:
            self._run("traversal", (counters, 4 * _FRUSTA_GROUPS), given, buffers, {**defines, "PART": "WHOLE"})
            return
        self._run("traversal", (counters, 4 * _FRUSTA_GROUPS), given, buffers, {**defines, "PART": "UPPER"})
        self._run("traversal", (counters, 4 * _TASKS_GROUPS), given, buffers, {**defines, "PART": "LOWER"})

    def decide(self, band: Band, room: int, uniforms: Mapping[str, Any], defines: Defines) -> None:
        """Decide in float64 what the traversal has left open."""
        buffers = {
            **self._some(DARK, COUNTERS, QUEUE),
            SAMPLES: band.given,
            UNSURE: self._room(UNSURE, PAIR_BYTES * room),
            **self._dimmed(band),
        }
        self._run("decide", _DECIDERS, {**uniforms, "room": room}, buffers, defines)

    def counted(self) -> tuple[int, int, NDArray[np.int32], dict[str, int]]:
        """Of the last frusta: tasks, pairs left open by float32, pairs `(p, 2)` left open by float64, tests."""
        counters = self._count()
        unsure = int(counters[_UNDECIDED])
        pairs = np.zeros((0, 2), np.int32)
        if unsure:
            pairs = np.frombuffer(self._kept[UNSURE].read(PAIR_BYTES * unsure), np.int32).reshape(-1, 2)
        tests = {name: int(counters[at]) + (int(counters[at + 1]) << 32) for name, at in _TESTS.items()}
        return int(counters[_TASKS_MADE]), int(counters[_QUEUED]), pairs, tests

    def merge(self, band: Band, samples: NDArray[np.int32], shares: NDArray[np.float32]) -> tuple[Any, Any]:
        """Buffers with a byte for each sample, 1 in shadow, and with the light that arrives; None if all are solid.

        To what the tree says come `shares (n, 3)` of light that `samples (n,)` get besides.
        """
        tiles, count, through = band.part.tiles, band.part.samples.size, self.through
        given = {**self._some(DARK, PRESENT), **self._dimmed(band), SAMPLES: band.given}
        all_samples = {**tiles.uniforms, "count": count}
        if through:
            self._run("own_share", groups_of(count), all_samples, {**self._some(FACING), **given}, self._by_chance)
        # Bits of chance are the samples' own; sums, and what is dark, come down to them.
        summed: Defines = {} if self._by_chance else through
        for level in reversed(range(0 if summed else 1, tiles.depth)):
            self._run("merge", groups_of(tiles.count(level)), {**tiles.uniforms, "level": level}, given, summed)
        size = -(-count // 4) * 4
        made = {VERDICT: self.reserve(size)}
        if through:
            made[PARTIAL] = self.reserve(12 * count)
        self._run("merge", groups_of(size // 4), all_samples, {**given, **made}, {"VERDICTS": 1, **through})
        if len(samples):
            buffers = {**made, FOUND: self.buffer(samples)}
            if through:
                buffers[SHARES] = self.buffer(shares)
            defines: Defines = {"SEE_THROUGH": 1} if through else {}
            self._run("mark", groups_of(len(samples)), {"count": len(samples)}, buffers, defines)
        return made[VERDICT], made.get(PARTIAL)

    @property
    def through(self) -> Defines:
        """For shaders that casters which let light through need."""
        return {"SEE_THROUGH": 1, **self._by_chance} if self._materials else {}

    def _dimmed_bytes(self, band: Band) -> int:
        """Three bits for each sample where chance decides, else three sums for each sample and node."""
        tiles = band.part.tiles
        if self._by_chance:
            return 12 * tiles.count(1)
        return 12 * (tiles.places + tiles.nodes) if self._materials else 0

    def _dimmed(self, band: Band) -> dict[int, Any]:
        """What casters have let through, and what chance needs to decide that."""
        if not self._materials:
            return {}
        return {**self._some(DIMMED), **({} if band.numbers is None else {NUMBERS: band.numbers})}

    def _run(
        self,
        name: str,
        groups: int | tuple[Any, int],
        uniforms: Mapping[str, Any],
        buffers: Mapping[int, Any],
        defines: Defines | None = None,
    ) -> None:
        given = {**uniforms, "colored": self._colored, "key": self._key}
        dispatch(self.session, HERE / f"{name}.glsl", groups, given, {**self._scene, **buffers}, defines)

    def _some(self, *bindings: int) -> dict[int, Any]:
        return {binding: self._kept[binding] for binding in bindings}

    def _room(self, binding: int, size: int) -> Any:
        """A buffer of at least that size, kept from call to call."""
        kept = self._kept.get(binding)
        if kept is None or kept.size < size:
            kept = self._kept[binding] = self.reserve(size)
        return kept

    def _counters(self) -> Any:
        """All counters at zero."""
        counters = self._room(COUNTERS, 4 * _COUNTERS)
        clear(self.session, counters)
        return counters

    def _count(self) -> NDArray[np.uint32]:
        return np.frombuffer(self._kept[COUNTERS].read(4 * _COUNTERS), np.uint32)
