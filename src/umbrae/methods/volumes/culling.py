"""Which triangles may cast a shadow that is seen: hierarchical occlusion culling of shadow volumes.

After Stich, Waechter and Keller 2007, section 11.3.3: a node of a tree of boxes casts no visible shadow if its box,
extruded away from the light, lies behind the samples, or outside of the picture. What was visible in the last frame is
entered without asking (Bittner, Wimmer, Piringer, Purgathofer 2004); whatever else there is to ask goes into one batch,
whose answers come before anything below is looked at. So each verdict is that of the present frame.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.geometry.extruded_boxes import AROUND, INSIDE, place_boxes
from umbrae.geometry.object_tree import ObjectTree, compact_objects, object_boxes, object_tree, refit
from umbrae.gl.compute import clear
from umbrae.gl.context import Session
from umbrae.gl.program import apply, program
from umbrae.gl.state import test_depth
from umbrae.gl.targets import CountTarget
from umbrae.light import Light
from umbrae.methods.volumes.view import Rounding
from umbrae.projection import Uniforms

FEW = 256
"""Triangles that are taken or left together: a box has up to nine faces, and they must be worth asking."""
_TURN = 8
"""In how many frames each node at the end of the way that was visible is asked once."""
_LIGHTS = 8
_QUADS = 6 + 12

Corners = NDArray[np.floating]
Ask = Callable[[Corners, Corners], NDArray[np.bool_]]


class Kept(NamedTuple):
    """`triangles (t,)`: those that must be drawn, None for all; `queries`: how many boxes were asked about."""

    triangles: NDArray[np.bool_] | None
    queries: int


@dataclass(eq=False)
class Memory:
    """What is known of each node under one light: whether it was visible, and in which frame that was found."""

    light: NDArray[np.float32]
    seen: NDArray[np.bool_]
    reached: NDArray[np.int32]
    frame: int = 0


class Culling:
    """A tree over a soup's objects, those of many triangles cut into compact ones; and what was visible lately."""

    tree: ObjectTree

    def __init__(
        self, positions: NDArray[np.float32], triangles: NDArray[np.int32], object_id: NDArray[np.int32]
    ) -> None:
        self._object = compact_objects(positions, triangles, object_id, FEW)
        self._count = count = int(self._object.max(initial=-1)) + 1
        self.tree = object_tree(*object_boxes(positions, triangles, self._object, count))
        self._memories: list[Memory] = []
        self._kept: NDArray[np.bool_] | None = None
        of_leaf = np.append(np.bincount(self._object, minlength=count), 0)[self.tree.order]
        self._below = _totals(of_leaf)
        self._is_end = self._below <= FEW
        self._is_end[self.tree.first_leaf :] = True

    def move(self, positions: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        """Follow the same triangles to where they are now; what was visible is taken as before: it is asked anew."""
        refit(self.tree, *object_boxes(positions, triangles, self._object, self._count))

    def around_eye(self, light: Light, camera: Camera, rounding: Rounding) -> NDArray[np.bool_]:
        """`(t,)` the triangles whose volumes may hold the eye, or have a face nearer to it than rounding allows."""
        view = _view(light, camera, np.zeros(4), rounding)
        taken = np.zeros(len(self.tree.lower), bool)
        nodes = np.zeros(1, np.int64)
        while len(nodes):
            nodes = nodes[self._below[nodes] > 0]
            place, _, _ = place_boxes(self.tree.lower[nodes], self.tree.upper[nodes], *view)
            nodes = nodes[place == AROUND]
            end = self._is_end[nodes]
            taken[nodes[end]] = True
            nodes = _children(nodes[~end])
        return self._triangles(taken)

    def kept(self, light: Light, camera: Camera, far_plane: NDArray[np.float64], rounding: Rounding, ask: Ask) -> Kept:
        """The triangles whose volumes reach before a sample.

        `far_plane (4,)` in world units; `ask` is given `(n, 3)` corners of boxes in world units, and says which of them
        show before the samples.
        """
        tree, memory = self.tree, self._memory(light)
        view = _view(light, camera, far_plane, rounding)
        memory.frame += 1
        frame, queries = memory.frame, 0
        taken = np.zeros(len(tree.lower), bool)
        found = np.zeros(0, np.int64)
        nodes = np.zeros(1, np.int64)
        while len(nodes):
            waiting = []
            while len(nodes):
                nodes = nodes[self._below[nodes] > 0]
                place, lower, upper = place_boxes(tree.lower[nodes], tree.upper[nodes], *view)
                end = self._is_end[nodes]
                known = memory.seen[nodes] & (memory.reached[nodes] == frame - 1)
                known &= ~(end & ((nodes + frame) % _TURN == 0))
                entered = (place == AROUND) | ((place == INSIDE) & known)
                asked = (place == INSIDE) & ~known
                memory.seen[nodes], memory.reached[nodes] = entered, frame
                taken[nodes[entered & end]] = True
                waiting.append((nodes[asked], lower[asked], upper[asked]))
                nodes = _children(nodes[entered & ~end])
            asked_nodes, lower, upper = (np.concatenate(parts) for parts in zip(*waiting, strict=True))
            if len(asked_nodes) == 0:
                break
            queries += len(asked_nodes)
            answered = asked_nodes[ask(lower, upper)]
            memory.seen[answered] = True
            end = self._is_end[answered]
            taken[answered[end]] = True
            found = np.append(found, answered[~end])
            nodes = _children(answered[~end])
        self._pull_up(memory, found)
        return Kept(self._same_or(self._triangles(taken)), queries)

    def _memory(self, light: Light) -> Memory:
        """That of the light, or a copy of the one that was nearest: a light that moves is a new one in every frame."""
        near = min(self._memories, key=lambda one: float(np.abs(one.light - light.position).max()), default=None)
        if near is None:
            nodes = len(self.tree.lower)
            near = Memory(light.position, np.zeros(nodes, bool), np.full(nodes, -1, np.int32))
        elif (near.light == light.position).all():
            return near
        else:
            near = Memory(light.position, near.seen.copy(), near.reached.copy(), near.frame)
        self._memories = [*self._memories[1 - _LIGHTS :], near]
        return near

    def _pull_up(self, memory: Memory, found: NDArray[np.int64]) -> None:
        """An inner node stays visible if a node below does; or if it has just been `found`, to ask right below next."""
        seen = memory.seen & (memory.reached == memory.frame)
        just = np.zeros(len(seen), bool)
        just[found] = True
        start = self.tree.first_leaf
        while start:
            start = (start - 1) // 2
            level, below = slice(start, 2 * start + 1), slice(2 * start + 1, 4 * start + 3)
            inner = ~self._is_end[level]
            seen[level] = np.where(inner, seen[below].reshape(-1, 2).any(axis=1) | just[level], seen[level])
        memory.seen = seen

    def _triangles(self, taken: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """`(t,)` the triangles below the nodes `taken`."""
        start = 0
        while start < self.tree.first_leaf:
            level, below = slice(start, 2 * start + 1), slice(2 * start + 1, 4 * start + 3)
            taken[below] |= np.repeat(taken[level], 2)
            start = 2 * start + 1
        order = self.tree.order
        of_object = np.zeros(len(order), bool)
        of_object[order[order >= 0]] = taken[self.tree.first_leaf :][order >= 0]
        triangles: NDArray[np.bool_] = of_object[self._object]
        return triangles

    def _same_or(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
        """The triangles of the last frame, or all of them, if they are those `chosen` and few more; else those.

        Drawing what is not seen changes nothing, and choosing anew means new buffers.
        """
        count = np.count_nonzero(chosen)
        for last in (self._kept, None):
            drawn = len(chosen) if last is None else np.count_nonzero(last)
            if drawn <= 1.25 * count and (last is None or not (chosen & ~last).any()):
                self._kept = last
                return last
        self._kept = chosen
        return chosen


def _view(light: Light, camera: Camera, far_plane: NDArray[np.float64], rounding: Rounding) -> tuple[Any, ...]:
    """What `place_boxes` asks for after the boxes; a picture is wider by two pixels, for samples off their centres."""
    slack = 1e-3 + 2.0 / min(camera.width, camera.height)
    position = light.position.astype(np.float64)
    return position, np.array(camera.eye), camera.world_to_clip, far_plane, slack, rounding.box_margin


def ask_boxes(
    session: Session, target: CountTarget, uniforms: Uniforms, lower: Corners, upper: Corners
) -> NDArray[np.bool_]:
    """`(n,)` which boxes, extruded away from the light, show before the depths of a target.

    All of them are one draw, whose fragments note their box in a buffer: an occlusion query for each would be as many
    draws. Corners `(n, 3)` are in the units of the positions that shaders get; they are rounded outwards.
    """
    context, count = session.moderngl, len(lower)
    content = np.hstack([_float32(lower, -np.inf), _float32(upper, np.inf)])
    seen = context.buffer(reserve=4 * count)
    clear(session, seen)
    drawn = program(session, Path(__file__).parent / "boxes.glsl")
    apply(drawn, uniforms)
    test_depth(session, target)
    seen.bind_to_storage_buffer(0)
    boxes = context.vertex_array(drawn, [(context.buffer(content.tobytes()), "3f 3f/i", "lower", "upper")])
    boxes.render(context.TRIANGLES, vertices=6 * _QUADS, instances=count)
    context.memory_barrier()
    answers: NDArray[np.bool_] = np.frombuffer(seen.read(), np.int32) != 0
    return answers


def _float32(values: Corners, towards: float) -> NDArray[np.float32]:
    """Rounded, and one step further."""
    beyond: NDArray[np.float32] = np.nextafter(values.astype(np.float32), np.float32(towards))
    return beyond


def _children(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([2 * nodes + 1, 2 * nodes + 2])


def _totals(of_leaf: NDArray[np.int64]) -> NDArray[np.int64]:
    """`(nodes,)` sums over a complete tree in heap order."""
    levels = [of_leaf]
    while len(levels[0]) > 1:
        levels.insert(0, levels[0].reshape(-1, 2).sum(axis=1))
    return np.concatenate(levels)
