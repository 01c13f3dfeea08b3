"""The one place that imports HDF5: without plug-ins, which a file could ask it to load."""

import os

# HDF5 reads this when it is loaded: "::" leaves no folder to load filters from.
os.environ["HDF5_PLUGIN_PRELOAD"] = "::"

from h5py import h5a, h5d, h5f, h5fd, h5g, h5l, h5o, h5p, h5s, h5t

__all__ = ["h5a", "h5d", "h5f", "h5fd", "h5g", "h5l", "h5o", "h5p", "h5s", "h5t"]
