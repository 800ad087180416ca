"""Triangle meshes as surfaces: what they are, their lines, and what a camera sees of them."""
