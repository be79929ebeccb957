"""Animations of glTF: known answers, real models evaluated a second time through pygltflib, files that are wrong."""

import json
import warnings
from pathlib import Path

import numpy as np
import pygltflib
import pytest

import umbrae as um
from animated import QUARTER, STILL, TRIANGLE, Writer, arm, turning
from umbrae.files import load, load_animation, names_of_animations
from umbrae.geometry.keyframes import Keyframes
from umbrae.geometry.outermost import outermost
from umbrae.geometry.transforms import composed

CHARACTERS = Path(__file__).parents[2] / "shared/scenes/characters"


def close(found, wanted):
    np.testing.assert_allclose(found, wanted, 0, 1e-6)


def keys(times, values, interpolation="LINEAR", rotates=False):
    return Keyframes(np.array(times, float), np.array(values, float), interpolation, rotates)


@pytest.mark.parametrize(
    ("interpolation", "at", "wanted"),
    [
        ("LINEAR", 1.0, 0.0), ("LINEAR", 1.5, 2.0), ("LINEAR", 3.0, 8.0), ("LINEAR", 0.0, 0.0), ("LINEAR", 9.0, 8.0),
        ("STEP", 1.0, 0.0), ("STEP", 2.999, 0.0), ("STEP", 3.0, 8.0), ("STEP", 9.0, 8.0),
    ],
)  # fmt: skip
def test_values_between_keyframes(interpolation, at, wanted):
    close(keys([1, 3], [[0], [8]], interpolation).at(at), [wanted])


@pytest.mark.parametrize(
    ("at", "wanted"),
    # The cubic through 0 and 8 of slopes 1 and 0, over 2 seconds: 2 (t^3 - 2 t^2 + t) + 8 (3 t^2 - 2 t^3).
    [(1.0, 0.0), (1.5, 2 * 0.140625 + 8 * 0.15625), (2.0, 2 * 0.125 + 4), (3.0, 8.0), (0.0, 0.0), (5.0, 8.0)],
)
def test_a_cubic_spline(at, wanted):
    close(keys([1, 3], [[[9], [0], [1]], [[0], [8], [9]]], "CUBICSPLINE").at(at), [wanted])


def test_one_keyframe_holds():
    for interpolation, values in (("LINEAR", [[4]]), ("STEP", [[4]]), ("CUBICSPLINE", [[[1], [4], [1]]])):
        for at in (0.0, 2.0, 7.0):
            close(keys([2], values, interpolation).at(at), [4])


@pytest.mark.parametrize("sign", [1, -1])
def test_rotations_take_the_shorter_arc(sign):
    half = keys([0, 1], [STILL, sign * np.array(QUARTER)], rotates=True).at(0.5)
    matrix = composed(np.zeros(3), half, np.ones(3))
    close(matrix[:3, 0], [np.sqrt(0.5), np.sqrt(0.5), 0])
    close(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3))


def test_a_third_of_a_quarter_turn_is_thirty_degrees():
    third = composed(np.zeros(3), keys([0, 3], [STILL, QUARTER], rotates=True).at(1.0), np.ones(3))
    close(third[:3, 0], [np.cos(np.pi / 6), np.sin(np.pi / 6), 0])


def test_cubic_rotations_have_length_one():
    values = [[[0, 0, 0, 0], STILL, [0, 0, 1, 0]], [[0, 1, 0, 0], QUARTER, [0, 0, 0, 0]]]
    close(np.linalg.norm(keys([0, 1], values, "CUBICSPLINE", True).at(0.4)), 1)


def test_a_node_turns(tmp_path):
    animation = load_animation(turning(tmp_path / "turn.gltf"))
    assert (animation.name, animation.duration) == ("turn", 2.0)
    np.testing.assert_array_equal(animation.scene.positions, TRIANGLE)
    root = np.sqrt(0.5)
    close(animation.at(1.0).positions, [[root, root, 0], [3 * root, 3 * root, 0], [root, root, 1]])
    for end in (2.0, 5.0):
        close(animation.at(end).positions, [[0, 1, 0], [0, 3, 0], [0, 1, 1]])
    close(animation.at(-1.0).positions, TRIANGLE)
    assert animation.at(1.0).family is animation.scene.family


def test_children_go_with_their_parents(tmp_path):
    nodes = [{"mesh": 0}, {"children": [0], "translation": [10, 0, 0]}]
    path = turning(tmp_path / "turn.gltf", (1, "scale", [0, 4], [[1, 1, 1], [3, 1, 2]]), nodes=nodes)
    animation = load_animation(path)
    assert animation.duration == 4.0
    close(animation.at(4.0).positions, [[10, 1, 0], [10, 3, 0], [10, 1, 2]])
    close(animation.at(2.0).positions, [[10, 1, 0], [10, 3, 0], [10, 1, 1.5]])


def test_what_does_not_move_stands_as_the_file_says(tmp_path):
    nodes = [{"mesh": 0}, {"mesh": 0, "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 7, 0, 1]}]
    path = turning(tmp_path / "turn.gltf", nodes=nodes)
    for moment in (0.0, 2.0):
        close(load_animation(path).at(moment).positions[3:], 2 * TRIANGLE + [0, 7, 0])
    np.testing.assert_array_equal(load_animation(path).scene.positions, load(path).positions)
    np.testing.assert_array_equal(load_animation(path).scene.triangles, load(path).triangles)


def test_a_skin_follows_its_bones(tmp_path):
    animation = load_animation(arm(tmp_path / "arm.gltf"))
    # The node of the mesh stands elsewhere, which a skin does not heed; the vertex of no triangle is gone.
    close(animation.scene.positions, [[0, 0, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [4, 0, 0], [4, 1, 0]])
    bent = animation.at(1.0)
    # Around the elbow (x - 2, y) goes to (-y, x - 2); the vertices of both bones lie in the middle.
    close(bent.positions, [[0, 0, 0], [0, 1, 0], [2, 0, 0], [1.5, 0.5, 0], [2, 2, 0], [1, 2, 0]])
    close(bent.normals, [[0, 0, 1]] * 6)
    np.testing.assert_array_equal(bent.triangles, animation.scene.triangles)


def test_weights_that_sum_up_to_something_else_are_brought_to_one(tmp_path):
    twice = [[2, 0, 0, 0]] * 3 + [[0.25, 0.25, 0, 0]] * 2 + [[7, 0, 0, 0]] * 2
    found, wanted = load_animation(arm(tmp_path / "a.gltf", twice)), load_animation(arm(tmp_path / "b.gltf"))
    close(found.at(0.7).positions, wanted.at(0.7).positions)


def instanced(made, **attributes):
    """The extension of a node whose mesh is there several times."""
    return {"EXT_mesh_gpu_instancing": {"attributes": {name: made.add(rows) for name, rows in attributes.items()}}}


def test_instances_stand_where_they_are_placed(tmp_path):
    made = Writer()
    places = instanced(
        made, TRANSLATION=[[0, 0, 0], [0, 5, 0]], ROTATION=[STILL, QUARTER], SCALE=[[1, 1, 1], [2, 1, 1]]
    )
    nodes = [{"mesh": 0, "extensions": places, "translation": [0, 0, 9]}, {"mesh": 0}]
    clip = made.clip((0, "translation", [0, 1], [[0, 0, 9], [0, 0, 8]]))
    path = made.write(
        tmp_path / "many.gltf",
        meshes=[made.mesh(TRIANGLE)],
        nodes=nodes,
        animations=[clip],
        extensionsUsed=["EXT_mesh_gpu_instancing"],
        extensionsRequired=["EXT_mesh_gpu_instancing"],
    )
    second = [[0, 7, 9], [0, 11, 9], [0, 7, 10]]
    scene = load(path)
    close(scene.positions, [*np.add(TRIANGLE, [[0, 0, 9]]), *second, *TRIANGLE])
    assert scene.object_id.tolist() == [0, 1, 2]
    animation = load_animation(path)
    np.testing.assert_array_equal(animation.scene.positions, scene.positions)
    close(animation.at(1.0).positions, [*np.add(TRIANGLE, [[0, 0, 8]]), *np.subtract(second, [[0, 0, 1]]), *TRIANGLE])


def test_instances_need_a_row_of_everything_for_each(tmp_path):
    made = Writer()
    places = instanced(made, TRANSLATION=[[0, 0, 0], [0, 5, 0]], SCALE=[[1, 1, 1]])
    path = made.write(tmp_path / "a.gltf", meshes=[made.mesh(TRIANGLE)], nodes=[{"mesh": 0, "extensions": places}])
    with pytest.raises(um.ModelError, match=r"with a row for each instance, got \[1, 2\] rows"):
        load(path)


def test_a_skin_and_instances_contradict_each_other(tmp_path):
    path = arm(tmp_path / "arm.gltf")
    tree = json.loads(path.read_text())
    tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}
    path.write_text(json.dumps(tree))
    with pytest.raises(um.ModelError, match="has a skin and instances"):
        load_animation(path)


def test_mirror_images_keep_their_outer_side(tmp_path):
    made = Writer()
    mesh = made.mesh(TRIANGLE, NORMAL=made.add([[0, -1, 0]] * 3))
    clip = made.clip((0, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]]))
    nodes = [{"mesh": 0, "scale": [-1, 1, 1]}]
    path = made.write(tmp_path / "mirror.gltf", meshes=[mesh], nodes=nodes, animations=[clip])
    scene, still = load_animation(path).at(1.0), load(path)
    np.testing.assert_array_equal(scene.triangles, still.triangles)
    close(scene.positions - still.positions, [[1, 0, 0]] * 3)
    close(scene.normals, [[0, -1, 0]] * 3)


def test_far_from_zero(tmp_path):
    nodes = [{"mesh": 0}, {"children": [0], "translation": [5e6 + 0.3, 0, 1e6]}]
    path = turning(tmp_path / "far.gltf", nodes=nodes)
    with pytest.warns(um.RecentredWarning):
        animation = load_animation(path)
    moved = animation.at(2.0)
    assert np.abs(moved.positions).max() < 10
    close(moved.positions + moved.origin, [[5e6 + 0.3, 1, 1e6], [5e6 + 0.3, 3, 1e6], [5e6 + 0.3, 1, 1e6 + 1]])


def test_casters_follow_an_animation(tmp_path):
    animation = load_animation(arm(tmp_path / "arm.gltf"))
    caster, light = um.METHODS["frustum"]().prepare(animation.scene), um.Light.directional((0, 0, -1))
    under = um.ViewSamples.points([(3, 0.5, -1), (1.4, 1.4, -1)])
    found = []
    for moment in (0.0, 1.0):
        caster.follow(animation.at(moment))
        found.append(caster.shadow(light, under).in_shadow.tolist())
    assert found == [[True, False], [False, True]]


def test_animations_have_names(tmp_path):
    made = Writer()
    clips = [made.clip((0, "translation", [0], [[x, 0, 0]]), name=name) for x, name in ((1, "one"), (2, "two"))]
    path = made.write(tmp_path / "two.gltf", meshes=[made.mesh(TRIANGLE)], nodes=[{"mesh": 0}], animations=clips)
    assert names_of_animations(path) == ("one", "two")
    assert [load_animation(path, name).scene.positions[0, 0] for name in (None, "one", "two")] == [2, 2, 3]
    with pytest.raises(um.ModelError, match="has no animation 'three', wanted one of: one, two"):
        load_animation(path, "three")


def test_outermost_vertices_hold_all_others(tmp_path):
    animation = load_animation(arm(tmp_path / "arm.gltf"))
    reach = animation.outermost()
    # The upper corner swings around the elbow: highest at sqrt(5), between two of the moments that are looked at.
    np.testing.assert_allclose([reach.min(axis=0), reach.max(axis=0)], [[0, 0, 0], [4, 5**0.5, 0]], 0, 1e-4)
    ball = np.random.default_rng(3).normal(size=(20_000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    few = outermost(ball)
    assert len(few) <= 128
    assert ((ball @ few.T).max(axis=1) > np.cos(np.radians(17))).all()


def test_what_is_not_followed_is_told(tmp_path):
    nodes = [{"mesh": 0, "children": [1]}, {"camera": 0}]
    with pytest.warns(UserWarning, match="moves cameras or lights"):
        load_animation(turning(tmp_path / "camera.gltf", nodes=nodes))
    path = turning(tmp_path / "pointer.gltf")
    tree = json.loads(path.read_text())
    tree["animations"][0]["channels"].append({"sampler": 0, "target": {"path": "pointer"}})
    path.write_text(json.dumps(tree))
    with pytest.warns(UserWarning, match="1 channels of the animation move no node"):
        load_animation(path)


WRONG = {
    "nothing moves": (("animations",), [], "has no animations"),
    "no channels": (("animations", 0, "channels"), [], "moves no node"),
    "morph targets": (("animations", 0, "channels", 0, "target", "path"), "weights", "morph targets"),
    "interpolation": (("animations", 0, "samplers", 0, "interpolation"), "CUBIC", "wanted LINEAR, STEP or CUBICSPLINE"),
    "values": (("animations", 0, "samplers", 0, "interpolation"), "CUBICSPLINE", "wanted 6 values, got 2"),
    "sampler": (("animations", 0, "channels", 0, "sampler"), 5, "wanted one of 1 samplers, got 5"),
    "node": (("animations", 0, "channels", 0, "target", "node"), 9, "wanted one of 3 nodes, got 9"),
    "width of values": (("animations", 0, "channels", 0, "target", "path"), "scale", "wanted rows of 3 finite numbers"),
    "input beyond the buffer": (("accessors", 6, "byteOffset"), 4, "overrun"),
    "no such input": (("animations", 0, "samplers", 0, "input"), 99, "wanted one of"),
    "matrix": (("nodes", 2, "matrix"), np.eye(4).ravel().tolist(), "has a matrix"),
    "circle": (("nodes", 2, "children"), [1], "must form a tree"),
    "two parents": (("nodes", 0, "children"), [2], "is reached twice"),
    "joint": (("skins", 0, "joints"), [1, 7], "wanted some of 3 nodes"),
    "no joints": (("skins", 0, "joints"), [], "wanted some of 3 nodes"),
    "too few joints": (("skins", 0, "joints"), [1], "joint 1 is out of range"),
    "skin": (("nodes", 0, "skin"), 4, "wanted one of 1 skins"),
    "inverse": (("skins", 0, "inverseBindMatrices"), 0, "wanted rows of 16 finite numbers"),
}


@pytest.mark.parametrize("name", list(WRONG))
def test_files_that_are_wrong(tmp_path, name):
    where, value, message = WRONG[name]
    path = arm(tmp_path / "arm.gltf")
    place = tree = json.loads(path.read_text())
    for step in where[:-1]:
        place = place[step]
    place[where[-1]] = value
    path.write_text(json.dumps(tree))
    with pytest.raises(um.ModelError) as caught:
        load_animation(path)
    assert message in str(caught.value) and str(caught.value).startswith(f"{path}: ")
    assert "malformed" not in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("times", [[1, 1], [2, 1], [-1, 1], [0, np.nan], []])
def test_times_that_are_wrong(tmp_path, times):
    made = Writer()
    clip = made.clip((0, "translation", times or np.zeros((0, 1)), [[0, 0, 0]] * len(times) or np.zeros((0, 3))))
    path = made.write(tmp_path / "t.gltf", meshes=[made.mesh(TRIANGLE)], nodes=[{"mesh": 0}], animations=[clip])
    with pytest.raises(um.ModelError, match=r"input: wanted (seconds from 0 that increase|rows of 1 finite)"):
        load_animation(path)


@pytest.mark.parametrize("weights", [[[0, 0, 0, 0]] * 7, [[-1, 2, 0, 0]] * 7, [[np.inf, 0, 0, 0]] * 7])
def test_weights_that_are_wrong(tmp_path, weights):
    with pytest.raises(um.ModelError, match="WEIGHTS_0: wanted weights from 0 that are not all zero"):
        load_animation(arm(tmp_path / "arm.gltf", weights))


def test_only_gltf_moves(tmp_path):
    um.save(um.Scene(TRIANGLE, [[0, 1, 2]]), tmp_path / "a.ply")
    assert names_of_animations(tmp_path / "a.ply") == ()
    with pytest.raises(um.ModelError, match=r"has no animations: wanted one of \.glb \.gltf"):
        load_animation(tmp_path / "a.ply")


def evaluated(path: Path, clip: int, seconds: float) -> list[np.ndarray]:
    """Positions of each primitive's vertices, one by one, read by pygltflib: slow, and nothing in common with ours."""
    model = pygltflib.GLTF2().load(str(path))
    blob = model.binary_blob()
    kinds = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
    widths = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}

    def rows(index):
        accessor = model.accessors[index]
        view = model.bufferViews[accessor.bufferView]
        kind, width = np.dtype(kinds[accessor.componentType]), widths[accessor.type]
        stride = view.byteStride or kind.itemsize * width
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        found = [np.frombuffer(blob, kind, width, start + i * stride) for i in range(accessor.count)]
        values = np.array(found, float)
        return values / np.iinfo(kind).max if accessor.normalized else values

    placing = {}
    for channel in model.animations[clip].channels:
        sampler = model.animations[clip].samplers[channel.sampler]
        times, values = rows(sampler.input)[:, 0], rows(sampler.output)
        assert sampler.interpolation == "LINEAR"
        if channel.target.path == "rotation":
            for i in range(1, len(values)):  # nlerp of many small steps comes near slerp only; so turn by the angle
                if values[i] @ values[i - 1] < 0:
                    values[i] *= -1
            i = int(np.clip(np.searchsorted(times, seconds) - 1, 0, max(len(times) - 2, 0)))
            j = min(i + 1, len(times) - 1)
            t = np.clip((seconds - times[i]) / (times[j] - times[i]), 0, 1) if j > i else 0.0
            angle = np.arccos(np.clip(values[i] @ values[j], -1, 1))
            value = values[i]
            if angle > 1e-3:
                value = (np.sin((1 - t) * angle) * values[i] + np.sin(t * angle) * values[j]) / np.sin(angle)
            elif j > i:
                value = (1 - t) * values[i] + t * values[j]
        else:
            value = np.array([np.interp(seconds, times, column) for column in values.T])
        placing[channel.target.node, channel.target.path] = value

    def local(index):
        node = model.nodes[index]
        if node.matrix is not None and (index, "rotation") not in placing and (index, "translation") not in placing:
            return np.array(node.matrix, float).reshape(4, 4).T
        x, y, z, w = (q := placing.get((index, "rotation"), node.rotation or STILL)) / np.linalg.norm(q)
        matrix = np.eye(4)
        vector = np.array([x, y, z])
        for k in range(3):
            unit = np.eye(3)[k]
            matrix[:3, k] = unit + 2 * np.cross(vector, np.cross(vector, unit) + w * unit)
        matrix[:3, :3] *= placing.get((index, "scale"), node.scale or [1, 1, 1])
        matrix[:3, 3] = placing.get((index, "translation"), node.translation or [0, 0, 0])
        return matrix

    parent = {child: index for index, node in enumerate(model.nodes) for child in node.children or []}

    def world(index):
        return local(index) if index not in parent else world(parent[index]) @ local(index)

    found = {}
    for index, node in enumerate(model.nodes):
        for number, primitive in enumerate(model.meshes[node.mesh].primitives if node.mesh is not None else []):
            points = rows(primitive.attributes.POSITION)
            if node.skin is None:
                found[index, number] = points @ world(index)[:3, :3].T + world(index)[:3, 3]
                continue
            skin = model.skins[node.skin]
            inverse = rows(skin.inverseBindMatrices).reshape(-1, 4, 4)
            bones = [world(joint) @ inverse[k].T for k, joint in enumerate(skin.joints)]
            joints, weights = rows(primitive.attributes.JOINTS_0).astype(int), rows(primitive.attributes.WEIGHTS_0)
            found[index, number] = np.array(
                [
                    sum(w * (bones[j] @ [*p, 1])[:3] for w, j in zip(ws / ws.sum(), js, strict=True))
                    for p, js, ws in zip(points, joints, weights, strict=True)
                ]
            )
    return list(found.values())


@pytest.mark.parametrize("name", ["Fox", "CesiumMan", "RiggedFigure", "CesiumMilkTruck"])
def test_real_models_move_as_a_second_evaluation_says(name):
    path = CHARACTERS / f"{name}.glb"
    if not path.exists():
        pytest.skip("the shared scenes are not there")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        clips = names_of_animations(path)
        for clip, title in list(enumerate(clips))[:2]:
            animation = load_animation(path, title)
            for seconds in (0.0, 0.37 * animation.duration):
                scene = animation.at(seconds)
                wanted = np.concatenate(evaluated(path, clip, seconds))
                size = np.abs(wanted).max()
                # Parts follow the nodes of the scene; vertices of no triangle are not there.
                distance = [np.abs(wanted - point).max(axis=1).min() for point in scene.positions[::17]]
                assert max(distance) < 2e-6 * size
                if len(wanted) == len(scene.positions) and name != "CesiumMilkTruck":
                    np.testing.assert_allclose(scene.positions, wanted, 0, 2e-6 * size)
