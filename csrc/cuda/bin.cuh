// Chords to tiles: intersections of both are counted and scattered, and each tile's are put in order and grouped by piece. Order is that of strokes,
// pieces and chords, so sums and ties do not hang on which thread came first.
#pragma once
#include "common/bin.h"
#include "cuda/sort.cuh"

namespace stroke {
// The intersections of one chord.
template <bool WRITE> __device__ void bin_chord(const Job &J, u32 chord) {
  const ChordInfo info = J.chord_info[chord];
  const u32 stroke = J.piece_info[info.piece].stroke, first_tile = u32(seen_in(layout_of(J), STROKES, stroke).view) * J.tiles_x * J.tiles_y;
  u32 n = 0;
  const u32 at = WRITE ? J.intersection_first[chord] : 0;
  visit_tiles(J.chords[chord], info.length, float(J.reach[stroke]), J.strata > 0, J.tiles_x, J.tiles_y, [&](int tx, int ty) {
    const u32 tile = first_tile + u32(ty * J.tiles_x + tx), intersection = at + n++;
    if (!WRITE) {
      atomicAdd(J.tile_first + tile, 1u);
      return;
    }
    J.intersection_chord[intersection] = chord, J.intersection_tile_piece[intersection] = NONE;
    J.tile_list[J.tile_first[tile] + atomicAdd(J.tile_cursor + tile, 1u)] = intersection;
  });
  if (!WRITE) J.intersection_first[chord] = n;
}

// Sorts n numbers by one block.
__device__ inline void sort_by_block(u32 *a, u32 n) {
  auto exchange = [&](u32 i, u32 j) {
    const u32 x = a[i], y = a[j];
    if (x > y) a[i] = y, a[j] = x;
  };
  sort_together(n, threadIdx.x, blockDim.x, exchange, [] { __syncthreads(); });
}

// Whether the chords of a part of tile_list follow on each other and turn so little that they have one nearest point.
__device__ inline bool is_smooth(const Job &J, u32 first, u32 last, float reach) {
  float bend = 0;
  for (u32 i = first; i < last; i++) {
    const u32 c = J.intersection_chord[J.tile_list[i]];
    const ChordInfo info = J.chord_info[c];
    if (info.turn * reach > float(TIGHT) * info.length) return false;
    if (i > first) {
      const Tangents a = J.tangents[c - 1], b = J.tangents[c];
      if (J.intersection_chord[J.tile_list[i - 1]] + 1 != c || J.chords[c - 1].tau0 + J.chords[c - 1].dtau != J.chords[c].tau0) return false;
      bend += turning<float>({a.bx, a.by}, {b.ax, b.ay});
    }
    bend += info.turn;
  }
  return bend < SMOOTH_TURN;
}

// The pieces over one tile, by one block; tile_list then holds chords.
__device__ inline void group_tile(const Job &J, u32 tile) {
  constexpr u32 SHORT = 1024;  // numbers that are sorted in shared memory (empirical: few tiles have more)
  __shared__ u32 near_by[SHORT];
  __shared__ u32 tile_piece_first;
  const u32 first = J.tile_first[tile], last = J.tile_first[tile + 1], n = last - first;
  if (n == 0) {
    if (threadIdx.x == 0) J.tile_piece_first[tile] = J.tile_piece_count[tile] = 0;
    return;
  }
  u32 *list = J.tile_list + first;
  if (n <= SHORT) {
    for (u32 i = threadIdx.x; i < n; i += blockDim.x) near_by[i] = list[i];
    __syncthreads();
    sort_by_block(near_by, n);
    for (u32 i = threadIdx.x; i < n; i += blockDim.x) list[i] = near_by[i];
    __syncthreads();
  } else sort_by_block(list, n);
  auto piece_at = [&](u32 i) { return J.chord_info[J.intersection_chord[list[i]]].piece; };
  auto starts = [&](u32 i) { return i < n && (i == 0 || piece_at(i) != piece_at(i - 1)); };
  u32 tile_pieces = 0;
  for (u32 base = 0; base < n; base += blockDim.x) {
    u32 total;
    block_prefix(starts(base + threadIdx.x), total);
    tile_pieces += total;
  }
  if (threadIdx.x == 0) {
    const u64 at = atomicAdd(J.counters + TILE_PIECES, u64(tile_pieces));
    tile_piece_first = at + tile_pieces <= J.limit[TILE_PIECES] ? u32(at) : NONE;
    J.tile_piece_first[tile] = u32(at), J.tile_piece_count[tile] = tile_pieces;
  }
  __syncthreads();
  u32 at = tile_piece_first;
  for (u32 base = 0; base < n; base += blockDim.x) {
    const u32 i = base + threadIdx.x;
    const bool head = starts(i);
    u32 total;
    const u32 tile_piece = at + block_prefix(head, total);
    at += total;
    if (!head || tile_piece_first == NONE) continue;
    u32 end = i + 1;
    while (end < n && !starts(end)) end++;
    const u32 piece = piece_at(i), stroke = J.piece_info[piece].stroke;
    J.intersection_tile_piece[list[i]] = tile_piece;
    J.tile_pieces[tile_piece] = {piece, stroke, first + i, is_smooth(J, first + i, first + end, float(J.reach[stroke]))};
  }
  __syncthreads();
  for (u32 i = threadIdx.x; i < n; i += blockDim.x) list[i] = J.intersection_chord[list[i]];
}
}  // namespace stroke
