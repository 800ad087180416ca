"""Surfaces: triangle meshes, from files, from grids and made finer or coarser, and unions of quadrics."""
