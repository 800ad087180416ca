// The kernels of the backward pass of Monte Carlo antialiasing that go through fragments: at the samples, and at the points on outlines.
#include "cuda/backward.cuh"
#include "cuda/launch.cuh"
#include "cuda/outline.cuh"

namespace stroke {
KERNEL(differentiate_samples, 256) { differentiate_tile<EVEN, false, true>(J); }
KERNEL(differentiate_samples_depth, 256) { differentiate_tile<EVEN, true, true>(J); }
KERNEL(differentiate_samples_oblong_depth, 256) { differentiate_tile<OBLONG, true, true>(J); }
KERNEL(value_outlines_image, 256) { value_outline<EVEN>(J); }
KERNEL(value_outlines_world, 256) { value_outline<WORLD>(J); }
KERNEL(value_outlines_image_along, 256) { value_outline<ALONG>(J); }
KERNEL(value_outlines_oblong_image, 256) { value_outline<OBLONG | ALONG>(J); }
KERNEL(value_outlines_oblong_world, 256) { value_outline<OBLONG | WORLD | ALONG>(J); }
KERNEL(value_outlines_world_along, 256) { value_outline<WORLD | ALONG>(J); }
}  // namespace stroke
