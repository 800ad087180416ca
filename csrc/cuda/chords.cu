// The next kernels of the forward pass, in the order of their launch: pieces to chords, and chords to tiles.
#include "cuda/bin.cuh"
#include "cuda/flatten.cuh"
#include "cuda/launch.cuh"

namespace stroke {
KERNEL(count_chords, 128) {
  each_warp(length_of(J, PIECES), [&](u32 i) { cut_piece<false>(J, i); });
}
KERNEL(place_chords, 1024) { total(J, CHORDS, J.chord_first, length_of(J, PIECES)); }
KERNEL(write_chords, 128) {
  if (fits(J, CHORDS)) each_warp(length_of(J, PIECES), [&](u32 i) { cut_piece<true>(J, i); });
}
KERNEL(count_intersections, 128) {
  each_thread(length_of(J, CHORDS), [&](u32 i) { bin_chord<false>(J, i); });
}
KERNEL(place_intersections, 1024) {  // two blocks
  if (blockIdx.x == 0) total(J, INTERSECTIONS, J.intersection_first, length_of(J, CHORDS));
  else add_up(J.tile_first, tile_count(J));
}
KERNEL(write_intersections, 128) {
  if (fits(J, INTERSECTIONS)) each_thread(length_of(J, CHORDS), [&](u32 i) { bin_chord<true>(J, i); });
}
KERNEL(group_tiles, 128) {  // a block for every tile
  if (fits(J, INTERSECTIONS)) group_tile(J, blockIdx.x);
}
}  // namespace stroke
