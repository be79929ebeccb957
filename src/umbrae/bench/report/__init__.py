"""Results of `umbrae bench` on one page."""
