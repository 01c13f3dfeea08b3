"""What goes on when, as other programs keep it: tiers, captions and labels of motion, both ways."""
