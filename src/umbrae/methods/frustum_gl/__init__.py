"""The frustum method in compute shaders."""
