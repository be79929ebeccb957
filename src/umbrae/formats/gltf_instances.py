"""Many copies of a mesh at one node: EXT_mesh_gpu_instancing."""

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import ModelError
from umbrae.formats.gltf_document import Document, Entry
from umbrae.geometry.transforms import composed

EXTENSION = "EXT_mesh_gpu_instancing"
AT_REST = {"translation": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0], "scale": [1.0, 1.0, 1.0]}
"""What places a node or an instance, and what it is where the file says nothing."""


def instances_of(document: Document, node: Entry) -> NDArray[np.float64]:
    """`(n, 4, 4)` from the mesh to its node, for each copy; the identity for a node with one."""
    extensions = node.entry("extensions")
    if EXTENSION not in extensions:
        return np.eye(4)[None]
    attributes = extensions.entry(EXTENSION).entry("attributes")
    given = {
        name: document.numbers(attributes, name.upper(), len(rest))
        for name, rest in AT_REST.items()
        if name.upper() in attributes
    }
    counts = {len(rows) for rows in given.values()}
    if len(counts) != 1:
        wanted = "TRANSLATION, ROTATION or SCALE, with a row for each instance"
        raise ModelError(f"{attributes.where}: wanted {wanted}, got {sorted(counts)} rows")
    (count,) = counts
    return composed(*(given.get(name, np.tile(np.array(rest), (count, 1))) for name, rest in AT_REST.items()))
