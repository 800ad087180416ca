"""Diffusion priors that are networks with published weights: one file a model, and what several share."""
