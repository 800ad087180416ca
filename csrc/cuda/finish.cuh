// Gradients of segments from the sums of their pieces over tiles and of their outlines, in double precision and a fixed order: one warp for each view and segment.
#pragma once
#include "cuda/warp.cuh"

namespace stroke {
constexpr u32 AT_ONCE = 8;  // numbers that are waited for together (empirical)
// This lane's number among the sums of a tile piece.
__device__ inline real tile_piece_sum(const Job &J, u32 tile_piece) {
  if (lane() < NGRAD) return J.g_tile_piece[u64(tile_piece) * NGRAD + lane()];
  return J.g_square && lane() < NSUMS ? J.g_square[u64(tile_piece) * 4 + lane() - NGRAD] : 0;
}
// This lane's number among the sums of a piece: over its intersections, that is chords and then tiles.
__device__ inline double piece_sum(const Job &J, u32 piece, u32 first_intersection, u32 last_intersection) {
  double sum = 0;
  for (u32 base = first_intersection; base < last_intersection; base += WARP) {
    const u32 intersection = base + lane(), tile_piece = intersection < last_intersection ? J.intersection_tile_piece[intersection] : NONE;
    for (u32 mask = __ballot_sync(ALL, tile_piece != NONE); mask;) {
      real some[AT_ONCE];
#pragma unroll
      for (u32 k = 0; k < AT_ONCE; k++) {
        const u32 from = __shfl_sync(ALL, tile_piece, __ffs(mask) - 1);
        some[k] = mask ? tile_piece_sum(J, from) : 0;
        mask &= mask - 1;
      }
#pragma unroll
      for (u32 k = 0; k < AT_ONCE; k++) sum += some[k];
    }
  }
  if (J.strata && lane() < NSUMS) sum += J.outline_sums[u64(piece) * NSUMS + lane()];
  return sum;
}

constexpr u32 FINISH_WARPS = 4;
__device__ inline void finish_segment(const Job &J, u32 i) {
  __shared__ double sums[FINISH_WARPS][WARP], controls[FINISH_WARPS][16], widths[FINISH_WARPS][4];
  const u32 warp = threadIdx.x / WARP;
  const bool good = fits(J, OUTLINE_FRAGMENTS);
  double out = 0;  // of the lanes: 16 numbers of the cubic; half widths, opacity, colour and T
  for (u32 p = good ? J.piece_first[i] : 0; good && p < J.piece_first[i + 1]; p++) {
    const PieceInfo &info = J.piece_info[p];
    const double sum = piece_sum(J, p, J.intersection_first[info.first_chord], J.intersection_first[info.end_chord]);
    sums[warp][lane()] = sum;
    __syncwarp();
    if (lane() == 0) control_gradient<double>(sums[warp], J.pieces[p], controls[warp]);
    if (lane() == 0) width_gradient(sums[warp] + OF_WIDTH, widths[warp]);
    __syncwarp();
    if (lane() < 16)
      for (int a = 0; a < 4; a++) out += info.map[4 * a + lane() / 4] * controls[warp][4 * a + lane() % 4];
    else if (J.along && lane() < OF_OPACITY)
      for (int a = 0; a < 4; a++) out += info.map[4 * a + lane() - OF_WIDTH] * widths[warp][a];
    else out += sum;
    __syncwarp();
  }
  if (lane() < 16) J.g_cubics[u64(i) * 16 + lane()] = good && J.piece_first[i] < J.piece_first[i + 1] ? out * J.scale[i] : 0;
  else if (lane() < NSUMS) J.g_appearance[u64(i) * (NSUMS - 16) + lane() - 16] = out;
}
}  // namespace stroke
