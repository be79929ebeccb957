"""Primary visibility: from a scene and a camera to view samples."""

from umbrae.sampling.cpu import sample
from umbrae.sampling.gl import sample_gl

__all__ = ["sample", "sample_gl"]
