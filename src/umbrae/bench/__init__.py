"""Benchmarks: cases times runners, measured side by side in one process."""
