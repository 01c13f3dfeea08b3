"""Motion templates: learn a class from examples and find it."""
