"""One file per model format: bytes in, `Scene` out, and back. `umbrae.files` chooses among them."""
