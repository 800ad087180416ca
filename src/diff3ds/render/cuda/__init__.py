"""The renderer on NVIDIA GPUs: kernels compiled when they are first needed, launched on torch's current stream."""
