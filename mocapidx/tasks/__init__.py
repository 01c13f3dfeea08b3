"""Whole jobs, one module a command: files in, files or records out."""
