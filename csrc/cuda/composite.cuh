// Occlusion: pixels of a tile composited (blended) from its fragments near to far (hits.cuh sorts them): one block a tile, one thread a pixel; analytic
// coverage, or strata of samples one after the other (docs/explanation/mathematics.md, eq. 7, 9, 10).
#pragma once
#include "common/hash.h"
#include "cuda/hits.cuh"

namespace stroke {
// Where stratum s samples the pixel (x, y) of a tile, relative to the tile: its centre, or a hashed place.
struct Place {
  real x, y;
};
__device__ inline Place place_of(const Job &J, const Tile &p, int s, int x, int y) {
  const int n = J.strata;
  if (!n) return {real(x) + real(.5), real(y) + real(.5)};
  const u32 base = mix(u32(J.seed) ^ mix(u32(J.seed >> 32) ^ mix(u32(p.view * n * n + s))));
  const u32 pixel = u32(p.y + y) * u32(J.width) + u32(p.x) + u32(x), u = mix(base ^ pixel), v = mix(u ^ 0x9e3779b9u);
  const float step = 1 / float(n);
  return {real(float(x) + (float(s % n) + unit(u)) * step), real(float(y) + (float(s / n) + unit(v)) * step)};
}
// Index of this thread's point among those of all strata and tiles.
__device__ inline u64 point_index(const Job &J, const Tile &p, int s) { return (u64(s) * tile_count(J) + p.index) * PIX + threadIdx.x; }
// Fragments by warp of a stratum that is kept for the backward, or of the only one.
__device__ inline WarpFragments *warp_fragments_of(const Job &J, const Tile &p, int s) {
  return J.warp_fragments + ((J.save ? u64(s) * J.limit[TILE_PIECES] : 0) + p.tile_piece_first) * WARPS;
}

struct Sums {
  real r, g, b, depth, ink, clear;
};
__device__ inline void composite(const Job &J, const u32 *order, u32 n, Sums &sums) {
  real T = 1;
  for (u32 k = 0; k < n; k++) {
    const Cover f = J.fragments[order[k]];
    const Piece<real> &c = J.pieces[f.piece];
    const real weight = T * f.a;  // in the blend
    sums.r += weight * c.color[0], sums.g += weight * c.color[1], sums.b += weight * c.color[2], sums.depth += weight * f.z, sums.ink += weight;
    T -= weight;
  }
  sums.clear += T;
}

template <int WIDTH> __device__ void draw_tile(const Job &J) {
  const Tile p = tile_at(J, blockIdx.x);
  const int x = pixel_x(threadIdx.x), y = pixel_y(threadIdx.x), strata = samples(J);
  const bool active = x < p.w && y < p.h;
  Pool pool = {J.fragments, J.order, nullptr, J.counters + FRAGMENTS, J.counters + ORDER, J.limit[FRAGMENTS], 0, 0};
  Sums sums = {};
  for (int s = 0; s < strata; s++) {
    const Place q = place_of(J, p, s, x, y);
    pool.warp_fragments = warp_fragments_of(J, p, s);
    u32 first = 0, n = 0;
    if (p.tile_piece_first < p.tile_piece_last) n = collect<WIDTH>(J, p, q.x, q.y, active, pool, first, [](const Hit &) { return true; });
    if (J.save) J.point_first[point_index(J, p, s)] = first, J.point_count[point_index(J, p, s)] = n;
    composite(J, J.order + first, n, sums);
  }
  if (!active) return;
  const real per_sample = real(1) / strata, *bg = background_at(J, p, x, y), clear = sums.clear * per_sample, ink = sums.ink * per_sample;
  const u64 at = pixel_index(J, p, x, y);
  J.out_color[3 * at] = sums.r * per_sample + clear * bg[0];
  J.out_color[3 * at + 1] = sums.g * per_sample + clear * bg[1];
  J.out_color[3 * at + 2] = sums.b * per_sample + clear * bg[2];
  J.out_alpha[at] = ink, J.out_depth[at] = ink > real(MIN_ALPHA) ? sums.depth / sums.ink : real(0);
}

// Tells the host what was needed. A thread for each counter: one after the other would wait for the host's memory each time. Drawings on
// several streams may tell at once: the greatest stays.
__device__ inline void report_needs(const Job &J) {
  const u32 k = thread_index();
  if (k < COUNTERS && J.report && J.counters[k]) atomicMax(J.report + k, J.counters[k]);
}

// The last of the forward: tells the host what was needed, and where that was more than there was, spoils the images so that nobody takes them
// for a drawing.
__device__ inline void conclude(const Job &J) {
  report_needs(J);
  if (fits(J, FRAGMENTS)) return;
  const u64 pixels = u64(J.views) * J.height * J.width;
  for (u64 i = thread_index(); i < pixels; i += thread_total()) {
    const real nan = real(0) / (J.inv_sigma - J.inv_sigma);
    for (int k = 0; k < 3; k++) J.out_color[3 * i + k] = nan;
    J.out_alpha[i] = J.out_depth[i] = nan;
  }
}
}  // namespace stroke
