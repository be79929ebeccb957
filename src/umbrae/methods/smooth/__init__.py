"""Smooth shadow boundaries (Mattausch et al. 2012): the silhouette, and two ways to count what it bounds."""
