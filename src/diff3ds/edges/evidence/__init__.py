"""What the pictures say: ridges, the views that show a curve, and how far a detector is off."""
