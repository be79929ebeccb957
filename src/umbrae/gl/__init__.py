"""OpenGL 4.5 without a window: context, programs, targets, state, timers. Knows no noun."""
