"""CAD and scene files with one feature each, for the tables of docs/reference/formats-read.md."""

from examples_of_3dm import RHINO
from examples_of_dxf import DXF
from examples_of_step import STEP
from examples_of_svg import SVG
from examples_of_usd import USD
from read_curves import read

__all__ = ["EXAMPLES", "read"]

EXAMPLES = {
    "DXF: `.dxf`": DXF,
    "Rhino: `.3dm`": RHINO,
    "STEP: `.step`, `.stp`": STEP,
    "SVG: `.svg`": SVG,
    "USD: `.usd`, `.usda`, `.usdc`, `.usdz`": USD,
}
