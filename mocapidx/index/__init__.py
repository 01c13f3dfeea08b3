"""Inverted lists of segments, one set a sub-index."""
