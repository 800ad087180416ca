"""What pictures show: masks, backgrounds, ink and its width, the hull of the object."""
