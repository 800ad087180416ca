"""CAD-like objects whose sharp edges are known exactly, and pictures of them as an edge detector would see them."""
