"""The files a rendering leaves behind, and the checks before the work starts."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae import files
from umbrae.errors import OutputError
from umbrae.image import Image
from umbrae.light import Light
from umbrae.scene import Scene


def check(model: Path, pictures: Sequence[Path], npz: Path | None) -> None:
    """Raise `OutputError` unless every path can be written, and none is the model or given twice."""
    check_paths(model, [*((path, files.IMAGES) for path in pictures), *([(npz, (".npz",))] if npz else [])])


def check_paths(model: Path, wanted: Sequence[tuple[Path, Collection[str]]]) -> None:
    """The same for paths, each with the extensions that it may have."""
    files.check_readable(model)
    taken = {model.resolve(): "the model"}
    for path, extensions in wanted:
        files.check_writable(path, extensions)
        if path.resolve() in taken:
            raise OutputError(f"{path}: would overwrite {taken[path.resolve()]}")
        taken[path.resolve()] = "another output"


def mask_paths(mask: Path | None, count: int) -> list[Path]:
    """One path per light: `mask` itself for one, `mask_1.png`, `mask_2.png`, ... for several."""
    if mask is None:
        return []
    if count == 1:
        return [mask]
    return [mask.with_stem(f"{mask.stem}_{number}") for number in range(1, count + 1)]


def arrays(scene: Scene, lights: Sequence[Light], image: Image) -> dict[str, NDArray[Any]]:
    """Samples, masks, lights and camera by name, all in the scene's coordinates: minus `origin`.

    Samples have the shape `(h, w)` or `(h, w, s)`, with the layers before it if there are several. `in_shadow` has that
    shape for one light; for several, lights come first, or right after layers. `transmittance`, beside it where some
    mask holds shares of light, has three channels after that. `throughput` is there for samples chosen by chance, and
    `depth` for all but those with smooth outlines.
    """
    samples = image.samples
    assert samples is not None and samples.camera is not None

    def stacked(values: Sequence[NDArray[Any]]) -> NDArray[Any]:
        return values[0] if len(values) == 1 else np.stack(values)

    found = {
        name: stacked([getattr(layer, name) for layer in image.layers])
        for name in ("triangle", "barycentric", "side", "position", "covered", "depth")
        if name != "depth" or samples.depth is not None
    }
    found["in_shadow"] = stacked([stacked([mask.in_shadow for mask in masks]) for masks in image.layer_masks])
    if any(mask.partial is not None for masks in image.layer_masks for mask in masks):
        found["transmittance"] = stacked(
            [stacked([mask.transmittance for mask in masks]) for masks in image.layer_masks]
        )
    if samples.throughput is not None:
        found["throughput"] = samples.throughput
    return found | {
        "lights": np.stack([light.position for light in lights]),
        "eye": samples.camera.eye,
        "axes": samples.camera.axes,
        "origin": scene.origin,
    }
