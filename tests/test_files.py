"""Models, pictures and arrays: what is written is read back, and files of known content give known scenes."""

import base64
import io
import json
import os
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
import trimesh
from PIL import Image as PillowImage

from umbrae.errors import InputError, ModelError, OutputError, RecentredWarning
from umbrae.files import IMAGES, check_writable, load, save, save_arrays, save_image
from umbrae.material import Material
from umbrae.scene import Scene

SHARED = Path(__file__).parents[2] / "shared/scenes"
GOOD = [
    path
    for name in (
        "cad",
        "characters",
        "foliage",
        "materials",
        "stanford/dragon_vrip_res4.ply",
        "stanford/bunny.obj",
    )
    for path in sorted((SHARED / name).rglob("*") if (SHARED / name).is_dir() else [SHARED / name])
    if path.suffix in (".glb", ".gltf", ".obj", ".ply") and path.exists()
]

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def gltf(folder: Path, attributes: dict[str, np.ndarray], **more: Any) -> Path:
    """A glTF file with one mesh of one primitive; each attribute in a buffer view and accessor of its own.

    An attribute may be given with its accessor's extra members: `(rows, {"normalized": True})`. `more` are
    top-level arrays, and `primitive` extra members of the primitive.
    """
    kinds = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
    types = {"u1": 5121, "i1": 5120, "u2": 5123, "u4": 5125, "f4": 5126}
    blob, views, accessors, names = b"", [], [], {}
    for name, value in attributes.items():
        rows, extra = value if isinstance(value, tuple) else (value, {})
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": rows.nbytes})
        component, width = types[rows.dtype.str[1:]], 1 if rows.ndim == 1 else rows.shape[1]
        accessor = {
            "bufferView": len(views) - 1,
            "componentType": component,
            "count": len(rows),
            "type": kinds[width],
        }
        accessors.append(accessor | extra)
        names[name] = len(accessors) - 1
        blob += rows.tobytes() + bytes(-rows.nbytes % 4)
    primitive = more.pop("primitive", {})
    if "indices" in names:
        primitive = {"indices": names.pop("indices")} | primitive
    uri = "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(blob), "uri": uri}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [{"attributes": {k: v for k, v in names.items() if k[0] != "_"}} | primitive]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    path = folder / "model.gltf"
    path.write_text(json.dumps(tree | more))
    return path


def rich_scene() -> Scene:
    """Two objects, four materials (two of them with the same picture), every attribute, an unused vertex."""
    random = np.random.default_rng(7)
    picture = random.integers(0, 256, (5, 3, 4), np.uint8)
    materials = [
        Material((0.25, 0.5, 0.75, 1.0), texture=picture, name="same"),
        Material((1, 1, 1, 1), "MASK", 0.3, texture=picture, double_sided=False, name="same"),
        Material((0.1, 0.2, 0.3, 0.4), "BLEND"),
        Material((0.9, 0.9, 0.9, 1.0), transmission=0.6, name="glass"),
    ]
    materials[1] = replace(materials[1], texture=materials[0].texture)
    normals = random.normal(size=(30, 3))
    return Scene(
        random.normal(size=(30, 3)).astype(np.float32),
        random.integers(0, 29, (40, 3)),
        materials=materials,
        material_id=np.arange(40) % 4,
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        uv=random.random((30, 2)).astype(np.float32) * 3 - 1,
        colors=random.random((30, 4)).astype(np.float32),
        object_id=np.repeat([0, 1], 20),
    )


def per_corner(scene: Scene, values: np.ndarray | None, order: np.ndarray) -> np.ndarray:
    assert values is not None
    return values[scene.triangles][order]


def test_glb_brings_everything_back(tmp_path: Path) -> None:
    scene = rich_scene()
    save(scene, tmp_path / "a.glb")
    back = load(tmp_path / "a.glb")
    order, same = np.lexsort((scene.material_id, scene.object_id)), np.arange(40)
    for name in ("positions", "normals", "uv", "colors"):
        wanted = per_corner(scene, getattr(scene, name), order)
        assert (per_corner(back, getattr(back, name), same) == wanted).all(), name
    assert (back.object_id == scene.object_id[order]).all()
    for index, other in zip(scene.material_id[order], back.material_id, strict=True):
        wanted, got = scene.materials[index], back.materials[other]
        assert replace(got, texture=None, alpha_cutoff=0.5).__dict__ == (
            replace(wanted, texture=None, alpha_cutoff=0.5).__dict__
        )
        assert got.alpha_cutoff == (wanted.alpha_cutoff if wanted.alpha_mode == "MASK" else 0.5)
        assert (got.texture is None) == (wanted.texture is None)
        assert got.texture is None or (got.texture == wanted.texture).all()
    assert len(back.materials) == 4
    assert back.materials[0].texture is back.materials[1].texture


def test_others_read_our_glb(tmp_path: Path) -> None:
    scene = rich_scene()
    save(scene, tmp_path / "a.glb")
    other = trimesh.load_scene(tmp_path / "a.glb", process=False)
    ours = np.sort(scene.positions[scene.triangles].reshape(-1, 9), axis=0)
    theirs = np.concatenate([mesh.triangles.reshape(-1, 9) for mesh in other.geometry.values()])
    assert (np.sort(theirs, axis=0) == ours).all()
    document = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    assert [material.name for material in document.materials] == ["same", "same", None, "glass"]
    assert [material.alphaMode for material in document.materials] == ["OPAQUE", "MASK", "BLEND", "OPAQUE"]
    assert document.materials[3].extensions == {"KHR_materials_transmission": {"transmissionFactor": 0.6}}
    assert document.extensionsUsed == ["KHR_materials_transmission"]
    assert len(document.images) == 1
    for accessor in document.accessors:
        assert document.bufferViews[accessor.bufferView].byteOffset % 4 == 0


@pytest.mark.parametrize("extension", [".obj", ".ply", ".stl"])
def test_simple_formats_keep_every_triangle(tmp_path: Path, extension: str) -> None:
    scene = rich_scene()
    tiny = Scene(scene.positions * np.float32(1e-6), scene.triangles)
    save(tiny, tmp_path / f"a{extension}")
    back = load(tmp_path / f"a{extension}")
    assert (back.positions[back.triangles] == tiny.positions[tiny.triangles]).all()


@pytest.mark.parametrize("path", GOOD, ids=lambda path: path.name)
def test_same_triangles_as_trimesh(path: Path) -> None:
    scene = load(path)
    other = trimesh.load_scene(path, process=False)
    theirs = []
    for node in other.graph.nodes_geometry:
        matrix, name = other.graph[node]
        points = other.geometry[name].vertices @ matrix[:3, :3].T + matrix[:3, 3]
        theirs.append(points[other.geometry[name].faces].reshape(-1, 9))
    wanted, got = np.concatenate(theirs), scene.positions[scene.triangles].reshape(-1, 9)
    assert len(wanted) == len(got)
    # The order of objects, and of corners in mirrored instances, may differ.
    wanted, got = (np.sort(rows.reshape(-1, 3), axis=0) for rows in (wanted, got))
    assert np.abs(wanted - got).max() <= 1e-6 * np.abs(wanted).max()


def test_nodes_place_meshes(tmp_path: Path) -> None:
    nodes = [
        {"translation": [10, 0, 0], "children": [1, 2]},
        {"mesh": 0, "rotation": [0, 0, np.sqrt(0.5), np.sqrt(0.5)], "scale": [2, 1, 1]},
        {"mesh": 0, "scale": [-1, 1, 1], "camera": 0},
        {"mesh": 0, "translation": [0, 0, 99]},
    ]
    normals = np.array([[0, 0, 1]] * 3, np.float32)
    path = gltf(
        tmp_path,
        {"POSITION": CORNERS, "NORMAL": normals},
        nodes=nodes,
        scene=1,
        scenes=[{"nodes": [3]}, {"nodes": [0]}],
    )
    scene = load(path)
    turned, mirrored = scene.positions[scene.triangles]
    assert np.allclose(turned, [[10, 0, 0], [10, 2, 0], [9, 0, 0]])
    # The outer side stays outside: the mirrored triangle is wound the other way round.
    assert np.allclose(mirrored, [[10, 1, 0], [9, 0, 0], [10, 0, 0]])
    assert np.allclose(scene.normals, [0, 0, 1])
    assert scene.object_id.tolist() == [0, 1]


def test_normals_stay_perpendicular(tmp_path: Path) -> None:
    normal = np.array([1, 1, 1], np.float32) / np.float32(np.sqrt(3))
    plane = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    for scale in ([3, 1, 0.5], [3, 1, -0.5], [1e-6, 2e-6, 3e-6], [-1, -1, -1]):
        nodes = [{"mesh": 0, "scale": scale, "rotation": [0.5, 0.5, 0.5, 0.5]}]
        scene = load(gltf(tmp_path, {"POSITION": plane, "NORMAL": np.array([normal] * 3)}, nodes=nodes))
        a, b, c = scene.positions[scene.triangles[0]].astype(float)
        facet = np.cross(b - a, c - a)
        assert scene.normals is not None
        assert np.allclose(scene.normals, facet / np.linalg.norm(facet), atol=1e-6)


def test_integers_and_sparse_rows(tmp_path: Path) -> None:
    uv = np.array([[0, 0], [65535, 0], [0, 13107]], np.uint16)
    moved = np.array([[5, 6, 7]], np.float32)
    sparse = {
        "count": 1,
        "indices": {"bufferView": 3, "componentType": 5123},
        "values": {"bufferView": 4},
    }
    attributes = {
        "POSITION": (CORNERS, {"sparse": sparse}),
        "TEXCOORD_0": (uv, {"normalized": True}),
        "COLOR_0": (np.array([[255, 0, 51]] * 3, np.uint8), {"normalized": True}),
        "_indices": np.array([2], np.uint16),
        "_values": moved,
    }
    picture = io.BytesIO()
    PillowImage.new("RGB", (2, 2)).save(picture, "PNG")
    scene = load(
        gltf(
            tmp_path,
            attributes,
            primitive={"material": 0},
            materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            textures=[{"source": 0}],
            images=[{"uri": "data:image/png;base64," + base64.b64encode(picture.getvalue()).decode()}],
        )
    )
    assert scene.positions.tolist() == [[0, 0, 0], [1, 0, 0], [5, 6, 7]]
    assert scene.uv is not None and np.allclose(scene.uv, [[0, 0], [1, 0], [0, 0.2]])
    assert scene.colors is not None and np.allclose(scene.colors, [1, 0, 0.2, 1])


@pytest.mark.parametrize(
    ("mode", "wanted"),
    [
        (4, [[0, 1, 2]]),
        (5, [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]]),
        (6, [[0, k, k + 1] for k in (1, 2, 3, 4)]),
    ],
)
def test_strips_and_fans(tmp_path: Path, mode: int, wanted: list[list[int]]) -> None:
    points = np.array([[k // 2, k % 2, 0] for k in range(6)], np.float32)
    indices = np.arange(3 if mode == 4 else 6, dtype=np.uint8)
    scene = load(gltf(tmp_path, {"POSITION": points, "indices": indices}, primitive={"mode": mode}))
    rolled = [np.roll(row, -int(np.argmin(row))).tolist() for row in scene.triangles]
    assert rolled == [np.roll(row, -int(np.argmin(row))).tolist() for row in wanted]


def upright_quad(extension: str, folder: Path) -> Path:
    """A square in the plane z = 0 with a picture whose upper half is red and whose lower half is blue."""
    picture = np.zeros((4, 4, 3), np.uint8)
    picture[:2, :, 0] = picture[2:, :, 2] = 255
    PillowImage.fromarray(picture).save(folder / "red over blue.png")
    path = folder / f"quad{extension}"
    if extension == ".obj":
        (folder / "quad.mtl").write_text("newmtl m\nKd 1 1 1\nd 0.5\nmap_Kd red over blue.png\n")
        text = "mtllib quad.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        path.write_text(text + "usemtl m\nf 1/1 2/2 3/3 4/4\n")
    elif extension == ".ply":
        header = "ply\nformat ascii 1.0\ncomment TextureFile red over blue.png\nelement vertex 4\n"
        header += "".join(f"property float {name}\n" for name in "xyzst")
        header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        path.write_text(header + "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3\n")
    else:
        points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
        uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
        made = gltf(
            folder,
            {"POSITION": points, "TEXCOORD_0": uv, "indices": np.array([0, 1, 2, 0, 2, 3], np.uint16)},
            primitive={"material": 0},
            materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            textures=[{"source": 0}],
            images=[{"uri": "red%20over%20blue.png"}],
        )
        path = made
    return path


@pytest.mark.parametrize("extension", [".gltf", ".obj", ".ply", "trimesh"])
def test_pictures_stand_upright(tmp_path: Path, extension: str) -> None:
    if extension == "trimesh":
        save(load(upright_quad(".gltf", tmp_path)), tmp_path / "quad.glb")
        scene = Scene.from_trimesh(trimesh.load_scene(tmp_path / "quad.glb", process=False))
    else:
        scene = load(upright_quad(extension, tmp_path))
    assert scene.uv is not None
    (texture,) = {id(m.texture): m.texture for m in scene.materials}.values()
    assert texture is not None and texture.shape == (4, 4, 4)
    assert len(scene.triangles) == 2
    for position, (u, v) in zip(scene.positions, scene.uv, strict=True):
        red, green, blue, alpha = texture[min(int(v * 4), 3), min(int(u * 4), 3)].tolist()
        assert (red, green, blue, alpha) == ((255, 0, 0, 255) if position[1] == 1 else (0, 0, 255, 255))


def test_texture_transform(tmp_path: Path) -> None:
    path = upright_quad(".gltf", tmp_path)
    tree = json.loads(path.read_text())
    info = tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
    info["extensions"] = {"KHR_texture_transform": {"offset": [0.5, 0.25], "scale": [2, 1], "rotation": np.pi / 2}}
    path.write_text(json.dumps(tree))
    scene = load(path)
    # (u, v) is scaled to (2 u, v), turned counter-clockwise in a picture whose v points down, then moved.
    assert scene.uv is not None
    assert np.allclose(scene.uv, [[0.5 + v, 0.25 - 2 * u] for u, v in ((0, 1), (1, 1), (1, 0), (0, 0))])


def test_obj_materials_objects_and_relative_indices(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl clear glass\nKd 0.1 0.2 0.3\nTr 0.25\nnewmtl wall\nKd .5 .5 .5\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\no first # a comment\nusemtl wall\n"
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -3//-1 -2//-1 -1//-1\n"
        "o second\nusemtl clear  glass\n"
        "v 5 0 0 1 1 1\nv 6 0 0 .5 .5 .5\nv 5 \\\n 1 0\nf -3 -2 -1\nf 1 2 \\\n 3\n"
    )
    scene = load(tmp_path / "a.obj")
    first, second = CORNERS.tolist(), [[5, 0, 0], [6, 0, 0], [5, 1, 0]]
    assert scene.positions[scene.triangles].tolist() == [first, second, first]
    assert scene.object_id.tolist() == [0, 1, 1]
    wall, glass = (scene.materials[index] for index in scene.material_id[:2])
    assert (wall.base_color, wall.alpha_mode) == ((0.5, 0.5, 0.5, 1.0), "OPAQUE")
    assert (glass.base_color, glass.alpha_mode) == ((0.1, 0.2, 0.3, 0.75), "BLEND")
    assert scene.normals is not None
    assert scene.normals[scene.triangles[:, 0]].tolist() == [[0, 0, 1], [0, 0, 0], [0, 0, 0]]
    assert scene.colors is not None
    # 0.5 in sRGB is 0.2140 in linear light.
    assert np.allclose(scene.colors[scene.triangles[1], 0], [1, 0.2140, 1], atol=1e-4)


def test_obj_without_its_library_is_grey(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("mtllib gone.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.warns(UserWarning, match=r"material library 'gone\.mtl' is missing"):
        scene = load(tmp_path / "a.obj")
    assert scene.materials[0].base_color == (0.8, 0.8, 0.8, 1.0)


def test_ply_colours_and_normals(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {n}\n" for n in ("x", "y", "z"))
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    colours = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    (tmp_path / "a.ply").write_text(header + colours + faces + "0 0 0 188 0 255\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n")
    scene = load(tmp_path / "a.ply")
    assert scene.normals is None
    assert scene.colors is not None
    # 188 of 255 in sRGB is 0.5029 in linear light.
    assert np.allclose(scene.colors[0], [0.5029, 0, 1, 1], atol=1e-4)
    normals = "".join(f"property float {name}\n" for name in ("nx", "ny", "nz"))
    (tmp_path / "b.ply").write_text(header + normals + faces + "0 0 0 0 1 0\n1 0 0 0 1 0\n0 1 0 0 1 0\n3 0 1 2\n")
    scene = load(tmp_path / "b.ply")
    assert scene.normals is not None and scene.normals.tolist() == [[0, 1, 0]] * 3


def test_far_from_the_origin(tmp_path: Path) -> None:
    path = gltf(tmp_path, {"POSITION": CORNERS / np.float32(3)}, nodes=[{"mesh": 0, "translation": [450_000.5, 0, 0]}])
    with pytest.warns(RecentredWarning):
        scene = load(path)
    world = scene.positions + scene.origin
    assert np.abs(world - (CORNERS / np.float32(3) + [450_000.5, 0, 0])).max() < 1e-7
    save(scene, tmp_path / "back.glb")
    with pytest.warns(RecentredWarning):
        back = load(tmp_path / "back.glb")
    assert (back.origin == scene.origin).all()
    assert np.abs(back.positions - scene.positions).max() < 1e-9


def test_a_warning_made_an_error_stays_a_warning(tmp_path: Path) -> None:
    path = gltf(tmp_path, {"POSITION": CORNERS / np.float32(3)}, nodes=[{"mesh": 0, "translation": [1e6, 0.1, 0]}])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(RecentredWarning):
            load(path)


def test_from_trimesh() -> None:
    box = trimesh.creation.box()
    box.visual.vertex_colors = [188, 0, 255, 255]
    scene = Scene.from_trimesh(box)
    assert (scene.positions[scene.triangles] == box.triangles).all()
    assert scene.colors is not None and np.allclose(scene.colors, [0.5029, 0, 1, 1], atol=1e-4)
    box.visual.face_colors = np.repeat([[255, 0, 0, 255], [0, 0, 0, 255]], 6, axis=0)
    scene = Scene.from_trimesh(box)
    assert scene.colors is not None
    assert (scene.colors[scene.triangles][:6, :, 0] == 1).all() and (scene.colors[scene.triangles][6:, :, 0] == 0).all()
    twice = trimesh.Scene()
    twice.add_geometry(box, "a", transform=np.diag([-1, 1, 1, 1]))
    twice.add_geometry(box, "b", transform=trimesh.transformations.translation_matrix([3, 0, 0]))
    scene = Scene.from_trimesh(twice)
    assert scene.object_id.tolist() == [0] * 12 + [1] * 12
    a, b, c = np.swapaxes(scene.positions[scene.triangles], 0, 1).astype(float)
    # The volume under a closed, outward wound surface is positive, mirrored or not.
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)).reshape(2, 12).sum(axis=1) / 6
    assert np.allclose(volumes, [1, 1])
    with pytest.raises(InputError, match="wanted a trimesh"):
        Scene.from_trimesh(np.zeros(3))
    with pytest.raises(ModelError, match="has no triangles"):
        Scene.from_trimesh(trimesh.Trimesh())


@pytest.mark.parametrize("extension", [extension for extension in IMAGES if extension not in (".jpg", ".jpeg")])
def test_pictures_come_back(tmp_path: Path, extension: str) -> None:
    pixels = np.zeros((4, 6, 3), np.uint8)
    pixels[:2, :3] = 255
    save_image(tmp_path / f"a{extension}", pixels)
    back = np.asarray(PillowImage.open(tmp_path / f"a{extension}").convert("RGB")).astype(int)
    assert np.abs(back - pixels).max() <= (255 if extension == ".webp" else 0)
    save_image(tmp_path / "mask.png", pixels[:, :, 0] > 0)
    with PillowImage.open(tmp_path / "mask.png") as mask:
        assert mask.mode == "L"
        assert (np.asarray(mask) == pixels[:, :, 0]).all()


def test_arrays_come_back(tmp_path: Path) -> None:
    save_arrays(tmp_path / "a.npz", one=np.arange(3), two=np.zeros((2, 2), bool))
    with np.load(tmp_path / "a.npz") as back:
        assert back["one"].tolist() == [0, 1, 2] and back["two"].shape == (2, 2)


class Broken:
    """Rows of a picture that cannot be had: something goes wrong half way."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        raise self.error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device"), MemoryError()])
def test_nothing_half_written_is_left(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(b"what was there before")
    with pytest.raises(OutputError if isinstance(error, OSError) else type(error)):
        save_arrays(path, first=np.arange(1000), second=Broken(error))  # type: ignore[arg-type]
    assert path.read_bytes() == b"what was there before"
    assert os.listdir(tmp_path) == ["a.npz"]


def test_written_files_are_ordinary(tmp_path: Path) -> None:
    (tmp_path / "link.png").symlink_to("target.png")
    save_image(tmp_path / "link.png", np.zeros((2, 2), np.uint8))
    assert (tmp_path / "link.png").is_symlink() and (tmp_path / "target.png").is_file()
    (tmp_path / "other").touch()
    assert (tmp_path / "target.png").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_paths_that_cannot_be_written(tmp_path: Path) -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    for name, reason in (
        ("a.xyz", r"unknown extension '\.xyz', wanted one of \.png"),
        ("a", "unknown extension ''"),
        ("gone/a.png", "no such folder"),
        ("folder.png", "is a folder"),
        ("pipe.png", "cannot be overwritten"),
        ("nul\0.png", "cannot be written"),
    ):
        with pytest.raises(OutputError, match=reason) as caught:
            save_image(tmp_path / name, pixels)
        assert "\n" not in str(caught.value)
    with pytest.raises(OutputError, match="unknown extension"):
        save(rich_scene(), tmp_path / "a.dae")
    with pytest.raises(OutputError, match="unknown extension"):
        save_arrays(tmp_path / "a.npy", a=pixels)
    with pytest.raises(InputError, match="save_image: wanted"):
        save_image(tmp_path / "a.png", pixels.astype(float))
    check_writable(tmp_path / "anything.xyz")
    assert sorted(os.listdir(tmp_path)) == ["folder.png", "pipe.png"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_folder_without_permission(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="not writable"):
        check_writable(tmp_path / "a.png")


def test_an_empty_scene_is_a_valid_file(tmp_path: Path) -> None:
    save(Scene(np.zeros((0, 3)), np.zeros((0, 3), int)), tmp_path / "a.glb")
    assert pygltflib.GLTF2().load(str(tmp_path / "a.glb")).asset.version == "2.0"
    with pytest.raises(ModelError, match="has no triangles"):
        load(tmp_path / "a.glb")
