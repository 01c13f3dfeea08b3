"""Pictures of templates, distance functions and annotations."""
