"""Adaptive segmentation: runs of equal feature words."""
