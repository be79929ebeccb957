"""A scene that moves over time: nodes and bones, and the vertices that hang on them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import number
from umbrae.geometry.keyframes import Keyframes
from umbrae.geometry.outermost import outermost
from umbrae.geometry.transforms import Floats, composed, transformed
from umbrae.scene import Scene

_MOMENTS = 100


class Skeleton(NamedTuple):
    """Nodes that carry each other.

    Attributes
    ----------
    parent
        `(n,)` node that each hangs on; -1 for none.
    order
        All nodes, each after the one it hangs on.
    local
        `(n, 4, 4)` node to parent, at rest.
    moving
        The nodes that move, with what they are at rest and what changes it: translation, rotation, scale.
    """

    parent: NDArray[np.int64]
    order: Sequence[int]
    local: Floats
    moving: Mapping[int, tuple["Track", "Track", "Track"]]

    def at(self, seconds: float) -> Floats:
        """`(n, 4, 4)` node to world."""
        world = self.local.copy()
        if self.moving:
            parts = (
                np.array([track.at(seconds) for track in each]) for each in zip(*self.moving.values(), strict=True)
            )
            world[list(self.moving)] = composed(*parts)
        for node in self.order:
            if self.parent[node] >= 0:
                world[node] = world[self.parent[node]] @ world[node]
        return world


class Track(NamedTuple):
    """Of a node's placing: the value at rest, and keyframes if it moves."""

    rest: Floats
    keyframes: Keyframes | None

    def at(self, seconds: float) -> Floats:
        """The value at a moment."""
        return self.rest if self.keyframes is None else self.keyframes.at(seconds)


class Skin(NamedTuple):
    """Bones of a mesh.

    `joints (j,)` nodes; `inverse (j, 4, 4)` from the mesh to each; of every vertex, `bone (n, k)` among the joints and
    `weight (n, k)`, which sum up to 1.
    """

    joints: NDArray[np.int64]
    inverse: Floats
    bone: NDArray[np.int64]
    weight: Floats

    def at(self, world: Floats) -> Floats:
        """`(n, 4, 4)` mesh to world, for each vertex."""
        bones = world[self.joints] @ self.inverse
        matrix = np.zeros((len(self.bone), 4, 4))
        for bone, weight in zip(self.bone.T, self.weight.T, strict=True):
            matrix += weight[:, None, None] * bones[bone]
        return matrix


class Piece(NamedTuple):
    """Vertices `(n, 3)`, with or without normals, that a node carries, `within (4, 4)` of it, or a skin."""

    positions: Floats
    normals: Floats | None
    node: int
    within: Floats
    skin: Skin | None

    def at(self, world: Floats) -> tuple[Floats, Floats | None]:
        """Positions and normals in the world."""
        matrix = world[self.node] @ self.within if self.skin is None else self.skin.at(world)
        return transformed(self.positions, self.normals, matrix)


@dataclass(frozen=True, eq=False)
class Animation:
    """A clip; made by `load_animation`.

    Attributes
    ----------
    scene
        The scene at second 0.
    duration
        Seconds until the last keyframe.
    name
        As the file has it.
    skeleton, pieces
        What moves, and the scene's vertices in their order.
    """

    scene: Scene
    duration: float
    name: str
    skeleton: Skeleton
    pieces: tuple[Piece, ...]

    def at(self, seconds: float) -> Scene:
        """The scene at a moment, a moved copy of `scene` (`Caster.follow` takes it); as at its ends beyond them.

        Raises
        ------
        InputError
            For no finite number, or vertices that fly beyond what a scene takes.
        """
        positions, normals = self._vertices(number(seconds, "Animation.at"))
        if self.scene.normals is None:
            return self.scene.moved(np.concatenate(positions))
        filled = [
            np.zeros_like(place) if normal is None else np.where(np.isfinite(normal), normal, 0.0)
            for place, normal in zip(positions, normals, strict=True)
        ]
        return self.scene.moved(np.concatenate(positions), np.concatenate(filled))

    def outermost(self) -> NDArray[np.float64]:
        """`(k, 3)` vertices that all others lie between, wherever they come to: what a camera must see to see all.

        As good as `geometry.outermost` is, at up to 100 moments evenly over the clip.
        """
        moments = np.linspace(0.0, self.duration, _MOMENTS if self.duration > 0 else 1).tolist()
        return outermost(np.concatenate([outermost(np.concatenate(self._vertices(each)[0])) for each in moments]))

    def _vertices(self, seconds: float) -> tuple[list[Floats], list[Floats | None]]:
        """Positions and normals of each piece, in the scene's coordinates."""
        world = self.skeleton.at(seconds)
        placed = [piece.at(world) for piece in self.pieces]
        return [positions - self.scene.origin for positions, _ in placed], [normals for _, normals in placed]
