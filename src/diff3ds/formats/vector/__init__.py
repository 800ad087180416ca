"""Views as vector paths: SVG and PDF."""
