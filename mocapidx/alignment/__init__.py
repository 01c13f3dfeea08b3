"""Alignment of sequences: dynamic time warping on arrays."""
