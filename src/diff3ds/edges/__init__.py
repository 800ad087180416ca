"""From the edges in posed pictures to 3D curves: subpixel ridges, carving, triangulation, chains, clean-up."""
