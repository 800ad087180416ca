// The boundary term of Monte Carlo gradients: points along outlines, and what the picture gains where each moves outwards (docs/explanation/mathematics.md,
// eq. 11, 12).
#pragma once
#include "common/outline.h"
#include "cuda/backward.cuh"

namespace stroke {
// As job.py has it.
static_assert(sizeof(OutlinePoint<real>) == 9 * sizeof(real));

__device__ inline u32 outline_tile(const Job &J, const OutlinePoint<real> &o) {  // NONE off the image
  if (!(o.x >= 0 && o.y >= 0 && o.x < J.width && o.y < J.height)) return NONE;
  return (u32(seen_in(layout_of(J), STROKES, J.piece_info[o.piece].stroke).view) * J.tiles_y + u32(o.y) / TILE) * J.tiles_x + u32(o.x) / TILE;
}
__device__ inline void count_outline(const Job &J, u32 piece) {
  J.outline_first[piece] =
      OutlineSampler<real, Job>(J, J.world, J.along, J.strata, J.seed, NONE).piece(piece, [](u32, const OutlinePoint<real> &) {});
}
// By one warp. Slots that stay empty lie nowhere: the host has filled them with NaN. The count was made by other code, which may round otherwise:
// a point too many is left out.
__device__ inline void sample_outline(const Job &J, u32 piece) {
  const u32 first = J.outline_first[piece], slots = J.outline_first[piece + 1] - first;
  OutlineSampler<real, Job>(J, J.world, J.along, J.strata, J.seed, lane(), WARP).piece(piece, [&](u32 slot, const OutlinePoint<real> &o) {
    if (slot >= slots) return;
    J.outline[first + slot] = o;
    const u32 tile = outline_tile(J, o);
    if (tile != NONE) atomicAdd(J.outline_tile_first + tile, 1u);
  });
}
__device__ inline void scatter_outline(const Job &J, u32 i) {
  const u32 tile = outline_tile(J, J.outline[i]);
  if (tile != NONE) J.outline_list[J.outline_tile_first[tile] + atomicAdd(J.outline_tile_cursor + tile, 1u)] = i;
}

// dL per unit of normal displacement at this thread's point: the value just inside less the value just outside, times the length that the point
// stands for. A point that lies inside another part of its own stroke, or nearer to a thinner one, is no outline.
template <int WIDTH> __device__ void value_outline(const Job &J) {
  const Tile p = tile_at(J, blockIdx.x);
  const u32 last = J.outline_tile_first[p.index + 1];
  Pool pool = {J.outline_fragments,
               J.outline_order,
               J.outline_warp_fragments + u64(p.tile_piece_first) * WARPS,
               J.counters + OUTLINE_FRAGMENTS,
               J.counters + OUTLINE_ORDER,
               J.limit[OUTLINE_FRAGMENTS],
               0,
               0};
  for (u32 base = J.outline_tile_first[p.index]; base < last; base += PIX) {
    const bool active = base + threadIdx.x < last;
    const u32 index = J.outline_list[active ? base + threadIdx.x : base];
    const OutlinePoint<real> o = J.outline[index];
    const Piece<real> &c = J.pieces[o.piece];
    const u32 own = J.piece_info[o.piece].stroke;
    const real x = o.x - p.x, y = o.y - p.y, own_depth = depth_at(c, o.tau, cubic(c.z, o.tau));
    const Upstream u = upstream_at(J, p, int(x), int(y), 1);
    bool hidden = false;
    u32 first;
    const u32 n = collect<WIDTH>(
        J, p, x, y, active, pool, first,
        [&](const Hit &hit) {
          if (J.tile_pieces[hit.tile_piece].stroke != own) return hit.a > 0;
          const Piece<real> &part = J.pieces[J.tile_pieces[hit.tile_piece].piece];
          const Query q = query<WIDTH>(part, p, x, y);
          const Point<real> point = point_at(part, hit.tau);
          const Fragment<real> g = fragment<WIDTH>(part, filter_of(J), point.tau, point.z, sqrt(distance2(point, q.x, q.y)));
          hidden = hidden || g.r - g.d > real(OUTLINE_SLACK) || (WIDTH != EVEN && g.d - g.r > real(OUTLINE_GAP));
          return false;
        },
        WIDTH != EVEN);
    if (!active) continue;
    real front = 1, behind = 0, clear = 1;
    for (u32 k = 0; k < n; k++) {
      const Cover f = J.outline_fragments[J.outline_order[first + k]];
      const Piece<real> &other = J.pieces[f.piece];
      if (f.z < own_depth || (f.z == own_depth && J.piece_info[f.piece].stroke > own)) front *= 1 - f.a;
      else behind += clear * f.a * value_of(u, other, f.z), clear *= 1 - f.a;
    }
    J.g_outline[index] = hidden ? 0 : front * c.opacity * (value_of(u, c, own_depth) - behind) * o.dtau;
  }
}

// Sums over the outline points of one piece, by one warp.
__device__ inline void sum_outline(const Job &J, u32 piece) {
  const Piece<real> &c = J.pieces[piece];
  union {
    Moments<real> m;
    real sums[NSUMS];
  } g = {};
  for (u32 i = J.outline_first[piece] + lane(); i < J.outline_first[piece + 1]; i += WARP) {
    const OutlinePoint<real> o = J.outline[i];
    if (outline_tile(J, o) == NONE || J.g_outline[i] == 0) continue;
    with_width(J.world, J.along, J.square, [&](auto width) { outline_adjoint<width>(c, o.tau, o.ux, o.uy, o.along, o.slope, J.g_outline[i], g.m); });
  }
  real sum = 0;
#pragma unroll
  for (u32 k = 0; k < NSUMS; k++) {
    const real total = warp_sum(g.sums[k]);
    if (lane() == k) sum = total;
  }
  if (lane() < NSUMS) J.outline_sums[u64(piece) * NSUMS + lane()] = sum;
}
}  // namespace stroke
