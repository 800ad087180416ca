"""Diffusion priors and score distillation. Sees images and cameras, never strokes."""
