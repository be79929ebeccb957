"""OpenGL 4.5 without a window: context, programs, targets, state, queries. Knows no noun."""
