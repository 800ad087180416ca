"""Formats of CAD programs: STEP, DXF and 3DM, exact curves there and back."""
