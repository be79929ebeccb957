"""The camera as shaders want it: what `gl/include/camera.glsl` asks for."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from umbrae.camera import Camera, pixel_offsets
from umbrae.scene import Scene

Uniforms = Mapping[str, Any]


def unit_scale(scene: Scene) -> float:
    """A power of two that brings the scene's largest coordinate near 1.

    Shaders compute in float32, whose range products of world coordinates would leave.
    """
    largest = float(np.abs(scene.bounds).max())
    return 2.0 ** -math.frexp(largest)[1] if largest > 0 else 1.0


def camera_uniforms(camera: Camera, scale: float, sample: int = 0, per_pixel: int = 1) -> Uniforms:
    """The projection of positions in units of 1 / `scale`; `sample` of `per_pixel` lies at the pixels' centres."""
    eye = camera.eye * scale
    high = eye.astype(np.float32)
    x, y, forward = camera.world_to_clip[:, :3]
    across, down = (offsets[sample] for offsets in pixel_offsets(per_pixel))
    # Moving the picture by part of a pixel brings the sample to the pixel's centre.
    x = x + (1.0 - 2.0 * across) / camera.width * forward
    y = y - (1.0 - 2.0 * down) / camera.height * forward
    return {
        "eye_high": tuple(high.tolist()),
        "eye_low": tuple((eye - high).tolist()),
        "picture_x": tuple(x.tolist()),
        "picture_y": tuple(y.tolist()),
        "forward": tuple(forward.tolist()),
        # Half of what would bring the near plane to depth 1: faces before it, clamped to 1, stay strictly nearer.
        "depth_scale": 0.5 * camera.near * scale,
    }
