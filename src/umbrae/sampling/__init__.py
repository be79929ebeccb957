"""Primary visibility: from a scene and a camera to view samples."""

from umbrae.sampling.cpu import sample
from umbrae.sampling.gl import sample_gl
from umbrae.sampling.layers import sample_layers
from umbrae.sampling.stochastic import sample_stochastic
from umbrae.sampling.tessellated import sample_tessellated

__all__ = ["sample", "sample_gl", "sample_layers", "sample_stochastic", "sample_tessellated"]
