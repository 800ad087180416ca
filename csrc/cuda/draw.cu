// The last kernels of the forward pass: tiles to images.
#include "cuda/launch.cuh"
#include "cuda/composite.cuh"

namespace stroke {
KERNEL(draw_image, 256) { draw_tile<false>(J); }
KERNEL(draw_world, 256) { draw_tile<true>(J); }
KERNEL(conclude_drawing, 256) { conclude(J); }
}  // namespace stroke
