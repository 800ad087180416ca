"""Curves as shapes: fitted, joined, evened out; what stands between rational curves as tensors and all that draws."""
