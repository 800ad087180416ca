// The first kernels of the forward pass, in the order of their launch: strokes to pieces.
#include "cuda/flatten.cuh"
#include "cuda/launch.cuh"
#include "cuda/project.cuh"

namespace stroke {
KERNEL(begin_drawing, 128) {
  each_thread(COUNTERS, [&](u32 k) { J.counters[k] = 0; });
  each_thread(tile_count(J) + 1, [&](u32 tile) { J.tile_first[tile] = 0; });
  each_thread(tile_count(J), [&](u32 tile) { J.tile_cursor[tile] = 0; });
  if (J.poses) each_thread(u32(J.views), [&](u32 view) { make_matrix(J, view, J.matrices + 16 * view); });
  if (J.controls) each_thread(segment_count(J), [&](u32 i) { project_segment(J, i); });
}
KERNEL(measure_strokes, 128) {  // of several segments
  each_thread(stroke_count(J), [&](u32 i) { measure_stroke(J, i); });
}
KERNEL(count_pieces, 128) {
  each_thread(segment_count(J), [&](u32 i) { cut_segment<false>(J, i); });
}
KERNEL(place_pieces, 1024) { total(J, PIECES, J.piece_first, segment_count(J)); }
KERNEL(write_pieces, 128) {
  if (fits(J, PIECES)) each_thread(segment_count(J), [&](u32 i) { cut_segment<true>(J, i); });
}
}  // namespace stroke
