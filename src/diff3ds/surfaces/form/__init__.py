"""Forms: what planes, cylinders, cones, spheres and tori a surface is made of, and the edges at which they meet."""
