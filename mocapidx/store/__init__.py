"""The store on disk; the only home of HDF5."""
