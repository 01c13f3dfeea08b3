"""Measurements: ratios against public peers and bare processes, all in one run."""
