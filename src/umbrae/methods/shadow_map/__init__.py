"""Shadow mapping (Williams 1978), to be compared with: fast, and wrong along edges."""
