"""Measurements: ratios against public peers and bare processes, all in one run."""

import os

# As the program does for itself; set before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
