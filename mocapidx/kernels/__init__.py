"""Optional compiled kernels; each has a twin in NumPy that gives the same bits."""
