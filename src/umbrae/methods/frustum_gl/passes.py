"""The passes of a frame: each a shader, its buffers and its uniforms."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import GraphicsError
from umbrae.gl.compute import clear, dispatch, groups_of
from umbrae.gl.context import Session
from umbrae.methods.frustum_gl.tiles import BRANCH, Tiles
from umbrae.methods.frustum_gl.uploaded import Band

HERE = Path(__file__).parent
(
    POSITIONS, TRIANGLES, FACING, OWN, BARYCENTRICS, SIDES, PLACES, BOXES, PRESENT, DARK, FRUSTA, COUNTERS, TASKS,
    QUEUE, UNSURE, VERDICT,
) = range(16)  # fmt: skip
"""Where the shaders find their buffers."""
SOLIDS, CULLED, FOUND = QUEUE, UNSURE, QUEUE
"""Where those find others that use neither of these."""

FRUSTUM_BYTES = 12 * 16
PAIR_BYTES = 8
_DECIDERS = 512
"""Groups of 64 that take pairs in turns."""
_COUNTERS = 18
_FRUSTA_GROUPS, _TASKS_GROUPS, _GROUPS_X = 12, 15, 256
_COUNTED = {
    "tile_frustum_tests": 4,
    "sample_frustum_tests": 6,
    "accepts": 8,
    "rejects": 10,
}
"""Counters of 64 bits; all of them as in `frustum.glsl`."""

Defines = dict[str, int | str]


class Passes:
    """What runs on the GPU for one scene, with the buffers that are kept from frame to frame.

    Parameters
    ----------
    session
        The OpenGL context, which must be current whenever a pass runs.
    positions, triangles
        The scene's.
    """

    def __init__(self, session: Session, positions: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        self.session = session
        self.most = session.integer("GL_MAX_SHADER_STORAGE_BLOCK_SIZE")
        for name, array in (("vertices", positions), ("triangles", triangles)):
            if array.nbytes > self.most:
                raise GraphicsError(
                    f"frustum-gl: {len(array)} {name} need {array.nbytes} bytes in one buffer, this OpenGL driver "
                    f"takes {self.most}; the method `frustum` needs no such buffer"
                )
        self._kept = {POSITIONS: self.buffer(positions), TRIANGLES: self.buffer(triangles)}

    def buffer(self, values: NDArray[Any]) -> Any:
        """A buffer with these values; never empty, which OpenGL does not allow."""
        return self.session.moderngl.buffer(np.ascontiguousarray(values).tobytes() or bytes(4))

    def reserve(self, size: int) -> Any:
        """A buffer of that many bytes, whatever they are."""
        return self.session.moderngl.buffer(reserve=max(size, 4))

    def place(self, band: Band, uniforms: Mapping[str, Any]) -> None:
        """Find the samples' places in the picture."""
        count = band.tiles.places
        buffers = {OWN: band.own, BARYCENTRICS: band.barycentrics, PLACES: band.places}
        self._run("place", groups_of(count), {**uniforms, **band.tiles.uniforms, "count": count}, buffers)

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
        return int(self._count()[3])

    def sides(self, count: int) -> NDArray[np.int32]:
        """What `face` has found, `(t,)`."""
        return np.frombuffer(self._kept[FACING].read(4 * count), np.int32).copy()

    def set_sides(self, sides: NDArray[np.int32]) -> None:
        """Replace what `face` has found."""
        self._kept[FACING].write(sides.tobytes())

    def build(self, band: Band) -> None:
        """Build the tree, from the leaves up, with no shadow in it."""
        tiles = band.tiles
        buffers = {
            **self._some(FACING),
            SIDES: band.sides,
            PLACES: band.places,
            BOXES: self._room(BOXES, 32 * tiles.nodes),
            PRESENT: self._room(PRESENT, 4 * tiles.words),
        }
        for level in range(1, tiles.depth + 1):
            leaves: Defines = {"LEAVES": 1} if level == 1 else {}
            self._run("hierarchy", groups_of(tiles.count(level)), {**tiles.uniforms, "level": level}, buffers, leaves)
        clear(self.session, self._room(DARK, 4 * tiles.words))

    def tree(self, tiles: Tiles) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """What `build` has found: `(nodes, 2, 4)` lowest and highest x, y, q; `(words,)` which children there are."""
        boxes = np.frombuffer(self._kept[BOXES].read(32 * tiles.nodes), np.float32)
        return boxes.reshape(-1, 2, 4), np.frombuffer(self._kept[PRESENT].read(4 * tiles.words), np.uint32)

    def places(self, band: Band) -> NDArray[np.uint32]:
        """What `place` has found, `(places, 4)`: the bits of x, y, q, and the own triangle."""
        return np.frombuffer(band.places.read(), np.uint32).reshape(-1, 4)

    def frusta(self) -> NDArray[np.uint32]:
        """What `set_up` has made last, `(n, 48)`: see `frustum.glsl`."""
        count = int(self._count()[0])
        return np.frombuffer(self._kept[FRUSTA].read(FRUSTUM_BYTES * count), np.uint32).reshape(count, -1)

    def set_up(self, count: int, uniforms: Mapping[str, Any], defines: Defines) -> None:
        """Make the frusta of `count` triangles from number `first` of the uniforms."""
        counters = np.zeros(_COUNTERS, np.uint32)
        counters[[_FRUSTA_GROUPS, _TASKS_GROUPS]] = _GROUPS_X
        counters[[_FRUSTA_GROUPS + 2, _TASKS_GROUPS + 2]] = 1
        self._room(COUNTERS, counters.nbytes).write(counters.tobytes())
        buffers = {**self._some(FACING, BOXES, COUNTERS), FRUSTA: self._room(FRUSTA, FRUSTUM_BYTES * count)}
        self._run("setup", groups_of(count), {**uniforms, "count": count}, buffers, defines)

    def traverse(self, band: Band, room: int, uniforms: Mapping[str, Any], defines: Defines) -> None:
        """Send the frusta down the tree."""
        counters = self._kept[COUNTERS]
        buffers = {
            **self._some(BOXES, PRESENT, DARK, FRUSTA, COUNTERS),
            PLACES: band.places,
            TASKS: self._room(TASKS, PAIR_BYTES * room),
            QUEUE: self._room(QUEUE, PAIR_BYTES * room),
        }
        given = {**uniforms, "room": room}
        if band.tiles.depth <= BRANCH:
            self._run("traversal", (counters, 4 * _FRUSTA_GROUPS), given, buffers, {**defines, "PART": "WHOLE"})
            return
        self._run("traversal", (counters, 4 * _FRUSTA_GROUPS), given, buffers, {**defines, "PART": "UPPER"})
        self._run("traversal", (counters, 4 * _TASKS_GROUPS), given, buffers, {**defines, "PART": "LOWER"})

    def decide(self, band: Band, room: int, uniforms: Mapping[str, Any]) -> None:
        """Decide in float64 what the traversal has left open."""
        buffers = {
            **self._some(DARK, COUNTERS, QUEUE),
            OWN: band.own,
            BARYCENTRICS: band.barycentrics,
            UNSURE: self._room(UNSURE, PAIR_BYTES * room),
        }
        self._run("decide", _DECIDERS, {**uniforms, "room": room}, buffers)

    def counted(self) -> tuple[int, int, NDArray[np.int32], dict[str, int]]:
        """Of the last frusta: tasks, pairs left open by float32, pairs `(p, 2)` left open by float64, tests."""
        counters = self._count()
        unsure = int(counters[3])
        pairs = np.zeros((0, 2), np.int32)
        if unsure:
            pairs = np.frombuffer(self._kept[UNSURE].read(PAIR_BYTES * unsure), np.int32).reshape(-1, 2)
        tests = {name: int(counters[at]) + (int(counters[at + 1]) << 32) for name, at in _COUNTED.items()}
        return int(counters[1]), int(counters[2]), pairs, tests

    def merge(self, band: Band, found: NDArray[np.int32]) -> Any:
        """A buffer with the verdicts, a byte for each sample: what the tree says, and those `found (n,)` besides."""
        tiles, size = band.tiles, -(-band.samples.size // 4) * 4
        words = self._some(DARK, PRESENT)
        for level in reversed(range(1, tiles.depth)):
            self._run("merge", groups_of(tiles.count(level)), {**tiles.uniforms, "level": level}, words)
        verdict = self.reserve(size)
        uniforms = {**tiles.uniforms, "count": band.samples.size}
        self._run("merge", groups_of(size // 4), uniforms, {**words, OWN: band.own, VERDICT: verdict}, {"VERDICTS": 1})
        if len(found):
            buffers = {FOUND: self.buffer(found), VERDICT: verdict}
            self._run("mark", groups_of(len(found)), {"count": len(found)}, buffers)
        return verdict

    def _run(
        self,
        name: str,
        groups: int | tuple[Any, int],
        uniforms: Mapping[str, Any],
        buffers: Mapping[int, Any],
        defines: Defines | None = None,
    ) -> None:
        given = {**self._some(POSITIONS, TRIANGLES), **buffers}
        dispatch(self.session, HERE / f"{name}.glsl", groups, uniforms, given, defines)

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
