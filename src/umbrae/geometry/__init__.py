"""Arrays in, arrays out: knows no noun and no OpenGL."""
