// From the gradient of a tile's pixels to that of its fragments, and their sums: one block a tile (docs/explanation/mathematics.md, eq. 9b, 10).
#pragma once
#include "cuda/composite.cuh"

namespace stroke {
// What the loss says of a pixel. A fragment adds T a (r, g, b) . (color - background) + T a ink + T a depth (its depth - mean) to it: as
// sum T a + T = 1, the background counts everywhere.
struct Upstream {
  real r, g, b, ink, depth, mean, background[3];
};
__device__ inline Upstream upstream_at(const Job &J, const Tile &p, int x, int y, real scale) {
  Upstream u = {};
  if (x >= p.w || y >= p.h || !fits(J, FRAGMENTS)) return u;  // an image that was spoilt has no gradient
  const u64 at = pixel_index(J, p, x, y);
  if (J.g_color) u.r = scale * J.g_color[3 * at], u.g = scale * J.g_color[3 * at + 1], u.b = scale * J.g_color[3 * at + 2];
  if (J.g_alpha) u.ink = scale * J.g_alpha[at];
  if (J.g_depth && J.out_alpha[at] > real(MIN_ALPHA)) u.depth = scale * J.g_depth[at] / J.out_alpha[at], u.mean = J.out_depth[at];
  const real *bg = background_at(J, p, x, y);
  for (int k = 0; k < 3; k++) u.background[k] = bg[k];
  return u;
}
__device__ inline real value_of(const Upstream &u, const Piece<real> &c, real z) {
  return (u.r * (c.color[0] - u.background[0]) + u.g * (c.color[1] - u.background[1])) +
         (u.b * (c.color[2] - u.background[2]) + u.depth * (z - u.mean)) + u.ink;
}

// Near to far the transmittance in front of each fragment, then far to near dL/d(alpha) = T (value - that of what is behind).
__device__ inline void differentiate_alpha(const Job &J, const u32 *order, u32 n, const Upstream &u, real &clear) {
  clear = 1;
  for (u32 k = 0; k < n; k++) {
    const u32 f = order[k];
    J.front[f] = clear;
    clear -= clear * J.fragments[f].a;
  }
  real behind = 0;
  for (u32 k = n; k-- > 0;) {
    const u32 f = order[k];
    const Cover c = J.fragments[f];
    const real excess = value_of(u, J.pieces[c.piece], c.z) - behind;
    J.g_fragment[f] = J.front[f] * excess;
    behind += c.a * excess;
  }
}

// Sums over the fragments of one tile piece, by one warp, added to those of the tile piece.
struct PixelGradient {
  real r, g, b, depth;
};
template <int WIDTH, bool DEPTH, bool SAMPLES>
__device__ void differentiate_tile_piece(const Job &J, const Tile &p, u32 tile_piece, const WarpFragments *warp_fragments, int s,
                                         const PixelGradient *upstream) {
  const Piece<real> &c = J.pieces[J.tile_pieces[tile_piece].piece];
  const Filter<real> filter = filter_of(J);
  const WarpFragments mine = lane() < WARPS ? warp_fragments[lane()] : WarpFragments{0, 0};
  u32 total;
  const u32 before = warp_prefix(__popc(mine.mask), total);
  if (!total) return;
  union {
    Moments<real> m;
    real sums[NSUMS];
  } g = {};
  for (u32 base = 0; base < total; base += WARP) {
    const u32 k = base + lane();
    u32 warp = 0, start = 0, bits = 0, rank = 0;
    for (u32 w = 0; w < WARPS; w++) {
      const u32 first = __shfl_sync(ALL, mine.first, w), mask = __shfl_sync(ALL, mine.mask, w), at = __shfl_sync(ALL, before, w);
      if (at <= k) warp = w, start = first, bits = mask, rank = k - at;
    }
    if (k >= total) continue;
    const u32 thread = warp * WARP + nth_bit(bits, rank), f = start + rank;
    const Place q = place_of(J, p, s, pixel_x(thread), pixel_y(thread));
    const Query at = query<WIDTH>(c, p, q.x, q.y);
    const Cover cover = J.fragments[f];
    const PixelGradient &u = upstream[thread];
    const real weight = J.front[f] * cover.a, ga = J.g_fragment[f];
    if (SAMPLES) {
      g.m.opacity += ga;
      if (DEPTH) depth_adjoint<WIDTH>(c, cover.tau, at.x, at.y, u.depth * weight, real(0), g.m, real(1));
    } else fragment_adjoint<WIDTH, DEPTH>(c, filter, cover.tau, at.x, at.y, ga, u.depth * weight, g.m);
    g.m.rgb[0] += weight * u.r, g.m.rgb[1] += weight * u.g, g.m.rgb[2] += weight * u.b;
  }
  real sum = 0;
#pragma unroll
  for (u32 k = 0; k < NGRAD; k++) {
    const real total_k = warp_sum(g.sums[k]);
    if (lane() == k) sum = total_k;
  }
  if (lane() < NGRAD) J.g_tile_piece[u64(tile_piece) * NGRAD + lane()] += sum;
  for (u32 k = 0; J.g_square && k < 4; k++) {
    const real total_k = warp_sum(g.m.square[k]);
    if (lane() == 0) J.g_square[u64(tile_piece) * 4 + k] += total_k;
  }
}

template <int WIDTH, bool DEPTH, bool SAMPLES> __device__ void differentiate_tile(const Job &J) {
  __shared__ PixelGradient upstream[PIX];
  const Tile p = tile_at(J, blockIdx.x);
  if (p.tile_piece_first == p.tile_piece_last && !J.g_background) return;
  const int x = pixel_x(threadIdx.x), y = pixel_y(threadIdx.x), strata = samples(J);
  const Upstream u = upstream_at(J, p, x, y, real(1) / strata);
  upstream[threadIdx.x] = {u.r, u.g, u.b, u.depth};
  for (u32 k = threadIdx.x; k < (p.tile_piece_last - p.tile_piece_first) * NGRAD; k += PIX) J.g_tile_piece[u64(p.tile_piece_first) * NGRAD + k] = 0;
  for (u32 k = threadIdx.x; J.g_square && k < (p.tile_piece_last - p.tile_piece_first) * 4; k += PIX) J.g_square[u64(p.tile_piece_first) * 4 + k] = 0;
  real background = 0;
  for (int s = 0; s < strata; s++) {
    real clear = 1;
    const u64 at = point_index(J, p, s);
    if (p.tile_piece_first < p.tile_piece_last) differentiate_alpha(J, J.order + J.point_first[at], J.point_count[at], u, clear);
    background += clear;
    __syncthreads();
    for (u32 r = p.tile_piece_first + threadIdx.x / WARP; r < p.tile_piece_last; r += WARPS)
      differentiate_tile_piece<WIDTH, DEPTH, SAMPLES>(J, p, r, warp_fragments_of(J, p, s) + u64(r - p.tile_piece_first) * WARPS, s, upstream);
    __syncthreads();
  }
  if (!J.g_background || x >= p.w || y >= p.h) return;
  real *out = J.g_background + 3 * pixel_index(J, p, x, y);
  out[0] = background * u.r, out[1] = background * u.g, out[2] = background * u.b;
}
}  // namespace stroke
