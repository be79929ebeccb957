"""Reading and writing of models, pictures and arrays: the only place that touches files."""

from umbrae.files.data import (
    CLIPS,
    IMAGES,
    load_image,
    load_text,
    save_arrays,
    save_clip,
    save_image,
    save_table,
    save_text,
)
from umbrae.files.model import (
    MODELS,
    SCALAR_MODELS,
    check_readable,
    load,
    load_animation,
    names_of_animations,
    save,
)
from umbrae.files.paths import check_writable
from umbrae.formats.meshes import scene_from_trimesh

__all__ = [
    "CLIPS",
    "IMAGES",
    "MODELS",
    "SCALAR_MODELS",
    "check_readable",
    "check_writable",
    "load",
    "load_animation",
    "load_image",
    "load_text",
    "names_of_animations",
    "save",
    "save_arrays",
    "save_clip",
    "save_image",
    "save_table",
    "save_text",
    "scene_from_trimesh",
]
