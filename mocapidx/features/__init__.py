"""Joint positions to boolean relational features."""
