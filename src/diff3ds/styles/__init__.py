"""Sketches as drawn by hand: vector brushes on the exact projected curves (the extra `styles`)."""

from diff3ds._svg import svg_pixels
from diff3ds.page.lines import Line
from diff3ds.styles.brushes import Scattered, Stretched, scattered, stretched
from diff3ds.styles.dry import CHARCOAL, PENCIL, Dry
from diff3ds.styles.pens import Dashed, Ink, Nib, Technical
from diff3ds.styles.style import Mark, Page, Style
from diff3ds.styles.styled_svg import styled_svg
from diff3ds.styles.wet import Marker, Watercolour

__all__ = [
    "CHARCOAL",
    "PENCIL",
    "Dashed",
    "Dry",
    "Ink",
    "Line",
    "Mark",
    "Marker",
    "Nib",
    "Page",
    "Scattered",
    "Stretched",
    "Style",
    "Technical",
    "Watercolour",
    "scattered",
    "stretched",
    "styled_svg",
    "svg_pixels",
]
