"""CAD-like objects whose sharp edges are known exactly, and pictures of them as an edge detector would see them."""

import importlib.util

if importlib.util.find_spec("OCP") is None:
    raise ModuleNotFoundError("these benchmarks need the CAD kernel: pip install 'diff3ds[cad]'")
