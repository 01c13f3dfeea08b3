"""New motion from examples: registration, blending, and steering by parameters."""
