"""Motion files: text and bytes in, recordings out."""
