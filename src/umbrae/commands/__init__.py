"""The commands of `umbrae`, one idea per file: arguments in, the library called, results out."""
