"""Primary visibility: from a scene and a camera to view samples."""

from umbrae.sampling.cpu import sample

__all__ = ["sample"]
