"""Cameras that other programs have found: COLMAP, Metashape, Bundler, OpenMVG and data sets, found in a folder."""
