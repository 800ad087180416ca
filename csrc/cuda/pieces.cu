// The first kernels of the forward pass, in the order of their launch: strokes to pieces.
#include "cuda/flatten.cuh"
#include "cuda/launch.cuh"
#include "cuda/project.cuh"

namespace stroke {
KERNEL(project_strokes, 128) {
  each_thread(stroke_count(J), [&](u32 i) { project_stroke(J, i); });
}
KERNEL(count_pieces, 128) {
  each_thread(stroke_count(J), [&](u32 i) { cut_stroke<false>(J, i); });
}
KERNEL(place_pieces, 1024) { total(J, PIECES, J.piece_first, stroke_count(J)); }
KERNEL(write_pieces, 128) {
  if (fits(J, PIECES)) each_thread(stroke_count(J), [&](u32 i) { cut_stroke<true>(J, i); });
}
}  // namespace stroke
