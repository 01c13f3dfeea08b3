"""Content-based queries on the inverted lists."""
