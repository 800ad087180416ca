// The last kernels of the forward pass: tiles to images.
#include "cuda/launch.cuh"
#include "cuda/composite.cuh"

namespace stroke {
KERNEL(draw_image, 256, BLOCKS) { draw_tile<EVEN>(J); }
KERNEL(draw_world, 256, BLOCKS) { draw_tile<WORLD>(J); }
KERNEL(draw_image_along, 256, BLOCKS) { draw_tile<ALONG>(J); }
KERNEL(draw_world_along, 256, BLOCKS) { draw_tile<WORLD | ALONG>(J); }
KERNEL(draw_oblong_image, 256, BLOCKS) { draw_tile<OBLONG | ALONG>(J); }
KERNEL(draw_oblong_world, 256, BLOCKS) { draw_tile<OBLONG | WORLD | ALONG>(J); }
KERNEL(conclude_drawing, 256) { conclude(J); }
}  // namespace stroke
