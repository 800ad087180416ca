// The kernels of the backward pass of analytic antialiasing; the last four end every backward pass.
#include "cuda/backward.cuh"
#include "cuda/finish.cuh"
#include "cuda/launch.cuh"
#include "cuda/project.cuh"

namespace stroke {
KERNEL(differentiate_image, 256, BLOCKS) { differentiate_tile<EVEN, false, false>(J); }
KERNEL(differentiate_image_depth, 256, BLOCKS) { differentiate_tile<EVEN, true, false>(J); }
KERNEL(differentiate_world, 256, BLOCKS) { differentiate_tile<WORLD, true, false>(J); }
KERNEL(differentiate_image_along, 256, BLOCKS) { differentiate_tile<ALONG, true, false>(J); }
KERNEL(differentiate_world_along, 256, BLOCKS) { differentiate_tile<WORLD | ALONG, true, false>(J); }
KERNEL(differentiate_oblong_image, 256, BLOCKS) { differentiate_tile<OBLONG | ALONG, true, false>(J); }
KERNEL(differentiate_oblong_world, 256, BLOCKS) { differentiate_tile<OBLONG | WORLD | ALONG, true, false>(J); }
KERNEL(finish_gradients, 128) {
  each_warp(segment_count(J), [&](u32 i) { finish_segment(J, i); });
}
KERNEL(gather_strokes, 128) {
  each_thread(u32(J.strokes), [&](u32 n) { gather_stroke(J, n); });
  each_thread(u32(J.segments), [&](u32 m) { gather_segment(J, m); });
  if (J.g_squares) each_thread(u32(J.views), [&](u32 view) { gather_square(J, view); });
}
KERNEL(gather_cameras, 128) { gather_camera(J, blockIdx.x); }  // a block for every view
KERNEL(conclude_gradients, 256) { report_needs(J); }
}  // namespace stroke
