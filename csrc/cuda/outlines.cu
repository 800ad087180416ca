// The kernels of the backward pass of Monte Carlo antialiasing that place the points on outlines, and sum what samples.cu finds there; in the
// order of their launch.
#include "cuda/launch.cuh"
#include "cuda/outline.cuh"

namespace stroke {
// Where the drawing found no room its pieces know no chords.
KERNEL(count_outlines, 128) {
  if (fits(J, FRAGMENTS)) each_thread(length_of(J, PIECES), [&](u32 i) { count_outline(J, i); });
}
KERNEL(place_outlines, 1024) { total(J, OUTLINE, J.outline_first, fits(J, FRAGMENTS) ? length_of(J, PIECES) : 0); }
KERNEL(write_outlines, 128) {
  if (fits(J, OUTLINE)) each_warp(length_of(J, PIECES), [&](u32 i) { sample_outline(J, i); });
}
KERNEL(place_outline_tiles, 1024) { add_up(J.outline_tile_first, tile_count(J)); }
KERNEL(scatter_outlines, 128) {
  each_thread(length_of(J, OUTLINE), [&](u32 i) { scatter_outline(J, i); });
}
KERNEL(sum_outlines, 128) {
  if (fits(J, OUTLINE)) each_warp(length_of(J, PIECES), [&](u32 i) { sum_outline(J, i); });
}
}  // namespace stroke
