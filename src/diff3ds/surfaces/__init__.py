"""What casts contours and hides lines."""
