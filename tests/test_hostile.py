"""Files that are broken, or built to break what reads them: a sane scene or one line that says why not."""

import json
import os
import struct
import time
import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as PillowImage

from umbrae.errors import CapacityError, ModelError, UmbraeError
from umbrae.files import load, save
from umbrae.material import Material
from umbrae.scene import Scene

SHARED = Path(__file__).parents[2] / "shared/scenes/hostile"
FOUND = [path for path in sorted(SHARED.rglob("*")) if path.is_file()]
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)


def attempt(path: Path) -> Scene | str:
    """What loading gives: a scene that holds what it should, or the one line that refuses it."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=UserWarning)
        try:
            scene = load(path)
        except UmbraeError as error:
            assert "\n" not in str(error)
            assert str(error).startswith(f"{path}: ") and len(str(error)) > len(f"{path}: ")
            assert "Warning" not in str(error)
            return str(error).removeprefix(f"{path}: ")
    assert len(scene.triangles) and np.isfinite(scene.positions).all()
    return scene


@pytest.mark.parametrize("path", FOUND, ids=lambda path: str(path.relative_to(SHARED)))
def test_found_in_the_wild(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    start = time.perf_counter()
    attempt(path)
    assert time.perf_counter() - start < 5
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("assimp/test/models/glTF2/MissingBin/BoxTextured.gltf", "buffers[0] 'BoxTextured0.bin' is missing"),
        ("assimp/test/models/glTF2/RecursiveNodes/RecursiveNodes.gltf", "nodes must form a tree"),
        (
            "assimp/test/models/glTF2/BoxWithInfinites-glTF-Binary/BoxWithInfinites.glb",
            "wanted finite numbers",
        ),
        ("assimp/test/models/glTF2/IndexOutOfRange/IndexOutOfRange.gltf", "index 255 is out of range"),
        ("assimp/test/models/OBJ/point_cloud.obj", "has no triangles"),
        ("assimp/test/models/invalid/malformed.obj", "line 28: a face names number 0"),
        ("tinygltf/models/BoundsChecking/integer-out-of-bounds.gltf", "got 1e+300"),
        ("trimesh/models/emptyIO/stl_empty_bin.stl", "has no triangles"),
    ],
)
def test_reasons(name: str, reason: str) -> None:
    if not (SHARED / name).exists():
        pytest.skip("the shared scenes are not there")
    answer = attempt(SHARED / name)
    assert isinstance(answer, str) and reason in answer


@pytest.fixture
def glb(tmp_path: Path) -> Path:
    """A good file with two objects, a picture, and every attribute."""
    material = Material((1, 1, 1, 1), texture=np.full((2, 2, 4), 200, np.uint8))
    scene = Scene(
        SQUARE,
        [[0, 1, 2], [0, 2, 3]],
        materials=[material],
        normals=[[0, 0, 1]] * 4,
        uv=SQUARE[:, :2],
        colors=np.ones((4, 4)),
        object_id=[0, 1],
    )
    save(scene, tmp_path / "good.glb")
    assert isinstance(attempt(tmp_path / "good.glb"), Scene)
    return tmp_path / "good.glb"


def unpacked(path: Path) -> tuple[dict[str, Any], bytes]:
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def packed(path: Path, tree: Any, body: bytes) -> Path:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def put(*path: Any) -> Callable[[dict[str, Any]], None]:
    """Change that sets the value at a path of keys, both given in one row: `put("nodes", 0, "mesh", 99)`."""

    def change(tree: dict[str, Any]) -> None:
        *keys, last, value = path
        place: Any = tree
        for key in keys:
            place = place[key]
        place[last] = value

    return change


DEEP = "[" * 100_000 + "]" * 100_000
CHANGES = {
    "index of a mesh": (put("nodes", 0, "mesh", 99), "nodes[0].mesh: wanted one of 2 meshes, got 99"),
    "negative index": (put("nodes", 0, "mesh", -1), "nodes[0].mesh: wanted a whole number, got -1"),
    "text for a number": (put("nodes", 0, "mesh", "0"), 'got "0"'),
    "true for a number": (put("nodes", 0, "mesh", True), "got true"),
    "number for an object": (put("nodes", 0, 7), "nodes[0]: wanted an object, got 7"),
    "object for an array": (put("meshes", {}), "meshes: wanted an array"),
    "null": (put("accessors", None), "accessors: wanted an array, got nothing"),
    "own child": (put("nodes", 0, "children", [0]), "nodes[0] is reached twice"),
    "child of two": (put("nodes", 0, "children", [1]), "nodes[1] is reached twice"),
    "missing child": (put("nodes", 0, "children", [5]), "nodes[0].children: wanted one of 2 nodes, got 5"),
    "not a number": (put("nodes", 0, "translation", [0, float("nan"), 0]), "wanted a finite number, got NaN"),
    "infinite": (put("nodes", 0, "scale", [1, 1e999, 1]), "wanted a finite number, got Infinity"),
    "overflow": (put("nodes", 0, "scale", [1e200, 1e200, 1]), "wanted magnitudes up to 1e18"),
    "short matrix": (put("nodes", 0, "matrix", [1, 0, 0]), "wanted 16 numbers"),
    "absurd count": (put("accessors", 0, "count", 10**12), "overrun bufferView"),
    "absurd zeros": (
        put("accessors", 0, {"componentType": 5126, "type": "VEC3", "count": 10**12}),
        "no bufferView",
    ),
    "absurd sparse zeros": (
        put("accessors", 0, {"componentType": 5126, "type": "VEC3", "count": 10**12, "sparse": {"count": 1}}),
        "is more than the file can hold",
    ),
    "view beyond buffer": (put("bufferViews", 0, "byteLength", 10**9), "ends at byte"),
    "offset beyond view": (put("accessors", 0, "byteOffset", 10**9), "overrun bufferView"),
    "buffer beyond file": (put("buffers", 0, "byteLength", 10**9), "wanted 1000000000"),
    "stride of nothing": (put("bufferViews", 1, "byteStride", 2), "do not fit a stride of 2"),
    "other type": (put("accessors", 0, "type", "MAT3"), "'MAT3' of component type 5126"),
    "other component": (put("accessors", 0, "componentType", 5124), "component type 5124"),
    "fewer normals": (put("accessors", 1, "count", 1), "wanted 3 rows (as POSITION has)"),
    "floats for indices": (put("meshes", 0, "primitives", 0, "indices", 0), "wanted unsigned whole numbers"),
    "mode": (put("meshes", 0, "primitives", 0, "mode", 9), "wanted 0 to 6, got 9"),
    "alpha mode": (put("materials", 0, "alphaMode", "DITHER"), "wanted OPAQUE, MASK or BLEND, got 'DITHER'"),
    "no such texture": (put("textures", 0, "source", 3), "textures[0].source: wanted one of 1 images, got 3"),
    "no source": (put("textures", 0, {}), "textures[0]: its picture is missing"),
    "points": (
        put("meshes", [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}] * 2),
        "has no triangles",
    ),
    "lines": (
        put("meshes", [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 3}]}] * 2),
        "has no triangles",
    ),
    "version": (put("asset", "version", "1.0"), "is glTF '1.0', wanted 2.0"),
    "draco": (
        put("extensionsRequired", ["KHR_draco_mesh_compression"]),
        "extension KHR_draco_mesh_compression",
    ),
    "meshopt": (put("extensionsRequired", ["EXT_meshopt_compression"]), "extension EXT_meshopt_compression"),
    "instances of nothing": (
        put("nodes", 0, "extensions", {"EXT_mesh_gpu_instancing": {"attributes": {}}}),
        "wanted TRANSLATION, ROTATION or SCALE, with a row for each instance, got [] rows",
    ),
    "instances that are no rotations": (
        put("nodes", 0, "extensions", {"EXT_mesh_gpu_instancing": {"attributes": {"ROTATION": 0}}}),
        "ROTATION: wanted rows of 4 finite numbers",
    ),
}
for outside in ("/etc/passwd", "../secret.bin", "a/../../secret.bin", "http://x.org/a.bin", "file:///etc/passwd",
                "C:\\a.bin", "..\\secret.bin", "%2e%2e/secret.bin", "\\\\host\\a.bin"):  # fmt: skip
    CHANGES[f"buffer {outside}"] = put("buffers", 0, "uri", outside), "outside the model's folder"
    CHANGES[f"image {outside}"] = put("images", 0, {"uri": outside}), "outside the model's folder"
for gone in ("gone.png", ".", "", "a" * 5000):
    CHANGES[f"picture {gone[:9]!r}"] = (
        put("images", 0, {"uri": gone}),
        "is missing",
    )


@pytest.mark.parametrize("name", CHANGES)
def test_wrong_members(glb: Path, name: str) -> None:
    change, reason = CHANGES[name]
    (glb.parent.parent / "secret.bin").write_bytes(bytes(10_000))
    tree, body = unpacked(glb)
    change(tree)
    tracemalloc.start()
    answer = attempt(packed(glb, tree, body))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert isinstance(answer, str) and reason in answer
    assert most < 20e6


def test_too_many_instances(glb: Path) -> None:
    tree, body = unpacked(glb)
    count = 10_000
    tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}, "indices": len(tree["accessors"])}]}]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": len(body), "byteLength": 3_000_000})
    accessor = {
        "bufferView": len(tree["bufferViews"]) - 1,
        "componentType": 5121,
        "type": "SCALAR",
        "count": 3_000_000,
    }
    tree["accessors"].append(accessor)
    tree["buffers"][0]["byteLength"] = len(body) + 3_000_000
    tree["nodes"] = [{"mesh": 0}] * count
    tree["scenes"] = [{"nodes": list(range(count))}]
    answer = attempt(packed(glb, tree, body + bytes(3_000_000)))
    assert isinstance(answer, str) and "GiB of memory" in answer
    with pytest.raises(CapacityError):
        load(glb)


def test_json_that_is_none(tmp_path: Path) -> None:
    for text in (
        DEEP,
        "{",
        "[]",
        "7",
        "null",
        '"text"',
        "\udcff",
        '{"asset": {"version": ' + "9" * 5000 + "}}",
    ):
        (tmp_path / "a.gltf").write_bytes(text.encode("utf-8", "surrogateescape"))
        assert isinstance(attempt(tmp_path / "a.gltf"), str)


def test_deep_nodes_do_not_overflow(glb: Path) -> None:
    tree, body = unpacked(glb)
    count = 20_000
    tree["nodes"] = [{"children": [index + 1]} for index in range(count)] + [{"mesh": 0}]
    tree["scenes"] = [{"nodes": [0]}]
    scene = attempt(packed(glb, tree, body))
    assert isinstance(scene, Scene) and len(scene.triangles) == 1


def test_truncated(glb: Path) -> None:
    data = glb.read_bytes()
    for length in [*range(64), *range(64, len(data), 5)]:
        glb.write_bytes(data[:length])
        assert isinstance(attempt(glb), str), length


@pytest.mark.parametrize("extension", [".glb", ".obj", ".ply", ".stl"])
def test_any_byte_changed(glb: Path, extension: str) -> None:
    path = glb.with_suffix(extension)
    if extension != ".glb":
        save(load(glb), path)
    good = path.read_bytes()
    random = np.random.default_rng(2011)
    for _ in range(300):
        data = bytearray(good)
        for place in random.integers(0, len(data), random.integers(1, 4)):
            data[place] = random.integers(0, 256)
        path.write_bytes(data)
        attempt(path)


PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
PLY_FACES = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
PLY_DATA = PLY_FACES + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
STL = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "a face names number 4 of 3 positions"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 2 3\n", "line 4: a face names number -4 of 3 positions"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n", "number 1 of 0 texture coordinates"),
        ("a.obj", f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {10**30}\n", "a face names number 1"),
        ("a.obj", "v 0 0 0\nv 1 0 x\nv 0 1 0\nf 1 2 3\n", "line 2 cannot be read: 'v 1 0 x'"),
        ("a.obj", "v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "number 1 of the positions has 2 numbers"),
        ("a.obj", "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", "wanted finite numbers"),
        ("a.obj", "v 0 0 0\nv 1 0 1e400\nv 0 1 0\nf 1 2 3\n", "wanted finite numbers"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\np 1\nf 1 2\n", "has no triangles"),
        ("a.obj", "mtllib ../a.mtl\n", "line 1: material library '../a.mtl' points outside"),
        ("a.obj", "mtllib /etc/passwd\n", "outside the model's folder"),
        ("a.ply", "ply\n", "its header is truncated"),
        ("a.ply", "solid\n", "is no PLY file"),
        ("a.ply", PLY + PLY_FACES + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "indices 0 to 3, wanted 0 to 2"),
        ("a.ply", PLY + PLY_FACES + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "has vertex indices -1 to 1"),
        ("a.ply", PLY + PLY_FACES + "0 0 0\n1 0 inf\n0 1 0\n3 0 1 2\n", "wanted finite numbers"),
        ("a.ply", PLY + PLY_FACES + "0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n", "truncated or malformed"),
        ("a.ply", PLY + PLY_FACES + "0 0 0\n1 0 0\n", "vertex 2 of 3 has 0 numbers"),
        ("a.ply", PLY + PLY_DATA.replace("face 1", "face 2"), "face 1 of 2 has 0 numbers"),
        ("a.ply", PLY + PLY_DATA.replace("face 1", "face 2") + "3 0 1\n", "face 1 of 2 has 3 numbers"),
        ("a.ply", PLY.replace("3", str(10**15)) + PLY_DATA, f"vertex 4 of {10**15}"),
        ("a.ply", PLY.replace("ascii", "binary_little_endian") + PLY_FACES + "0", "truncated or malformed"),
        ("a.ply", PLY + "comment TextureFile ../a.png\n" + PLY_DATA, "outside"),
        ("a.stl", "solid a\nendsolid a\n", "has no triangles"),
        ("a.stl", STL, "0 of 3 vertices belong to a complete solid"),
        ("a.stl", STL + "endsolid a\n" + STL, "3 of 6 vertices belong to a complete solid"),
        ("a.stl", STL.replace("1 0 0", "1 0") + "endsolid a\n", "truncated or malformed"),
        ("a.stl", STL.replace("1 0 0", "1 0 nan") + "endsolid a\n", "wanted finite numbers"),
        ("a.stl", "x" * 84, "is truncated or malformed: 84 bytes"),
        ("a.stl", "short", "is truncated or malformed: 5 bytes"),
        ("a.xyz", "1 2 3", "unknown extension '.xyz', wanted one of .glb .gltf .obj .ply .stl"),
        ("a", "1 2 3", "unknown extension ''"),
        ("a.glb", "glTF", "is truncated: 4 bytes"),
        ("a.glb", "", "is empty"),
    ],
)  # fmt: skip
def test_wrong_text(tmp_path: Path, name: str, content: str, reason: str) -> None:
    (tmp_path / name).write_text(content)
    answer = attempt(tmp_path / name)
    assert isinstance(answer, str) and reason in answer


def test_binary_ply_of_triangles_and_quads_is_refused(tmp_path: Path) -> None:
    header = PLY.replace("ascii", "binary_little_endian").replace("vertex 3", "vertex 5")
    header += PLY_FACES.replace("face 1", "face 3")
    # As many bytes as three quads would take: read as such, the second face would be made of garbage.
    faces = b"".join(
        struct.pack(f"<B{len(face)}i", len(face), *face) for face in ([0, 1, 2, 3], [0, 1, 2], [4, 3, 2, 1, 0])
    )
    (tmp_path / "a.ply").write_bytes(header.encode() + np.zeros((5, 3), "<f4").tobytes() + faces)
    answer = attempt(tmp_path / "a.ply")
    assert isinstance(answer, str) and "different numbers of corners" in answer


def test_the_reader_behind_stl_logs_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "a.stl").write_text(STL.replace("normal 0 0 1", "normal 0 0 up") + "endsolid a\n")
    assert len(load(tmp_path / "a.stl").triangles) == 1
    assert caplog.records == []


def test_stl_with_a_wrong_count(tmp_path: Path) -> None:
    save(Scene(SQUARE, [[0, 1, 2], [0, 2, 3]]), tmp_path / "a.stl")
    data = bytearray((tmp_path / "a.stl").read_bytes())
    for count in (0, 1, 3, 2**32 - 1):
        data[80:84] = struct.pack("<I", count)
        (tmp_path / "a.stl").write_bytes(data)
        answer = attempt(tmp_path / "a.stl")
        assert isinstance(answer, str) and f"{count} triangles" in answer


@pytest.mark.parametrize("line", ["map_Kd gone.png", "map_Kd a.mtl", "map_Kd ../b.png", "map_Kd /etc/passwd"])
def test_obj_textures(tmp_path: Path, line: str) -> None:
    PillowImage.new("RGB", (2, 2)).save(tmp_path.parent / "b.png")
    (tmp_path / "a.mtl").write_text(f"newmtl m\n{line}\n")
    text = "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(text)
    answer = attempt(tmp_path / "a.obj")
    assert isinstance(answer, str) and f"texture {line.split()[1]!r}" in answer
    # A material that nothing uses may name what it likes below the folder.
    (tmp_path / "a.obj").write_text(text.replace("usemtl m\n", ""))
    assert isinstance(attempt(tmp_path / "a.obj"), str) == ("/" in line)


def test_a_picture_that_explodes(glb: Path) -> None:
    tree, body = unpacked(glb)
    tree["images"] = [{"uri": "bomb.png"}]
    PillowImage.new("1", (10_000, 10_000)).save(glb.parent / "bomb.png")
    answer = attempt(packed(glb, tree, body))
    assert isinstance(answer, str) and "texture 'bomb.png' is too large" in answer


def test_what_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "folder.glb").mkdir()
    os.mkfifo(tmp_path / "pipe.glb")
    for name, reason in (
        ("gone.glb", "no such file"),
        ("folder.glb", "is not a file"),
        ("pipe.glb", "is not a file"),
    ):
        with pytest.raises(ModelError, match=reason):
            load(tmp_path / name)
    with pytest.raises(ModelError, match="no such file"):
        load(tmp_path / ("a" * 5000 + ".glb"))
    with pytest.raises(ModelError):
        load(tmp_path / "nul\0.glb")
    os.mkfifo(tmp_path / "pipe.mtl")
    (tmp_path / "a.obj").write_text("mtllib pipe.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.warns(UserWarning, match=r"'pipe\.mtl' is missing"):
        load(tmp_path / "a.obj")
