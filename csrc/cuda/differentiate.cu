// The kernels of the backward pass of analytic antialiasing; the last two end every backward pass.
#include "entry.cuh"
#include "finish.cuh"
#include "shade.cuh"

namespace stroke {
KERNEL(differentiate_image, 256) { differentiate_tile<false, false, false>(J); }
KERNEL(differentiate_image_depth, 256) { differentiate_tile<false, true, false>(J); }
KERNEL(differentiate_world, 256) { differentiate_tile<true, true, false>(J); }
KERNEL(finish_gradients, 128) { each_warp(stroke_count(J), [&](u32 i) { finish_stroke(J, i); }); }
KERNEL(conclude_gradients, 256) { report_needs(J); }
}  // namespace stroke
