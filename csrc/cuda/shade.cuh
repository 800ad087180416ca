// Pixels of a tile from its fragments and back: one block a tile, one thread a pixel; analytic coverage, or strata of samples one after the other
// (docs/explanation/mathematics.md, eq. 7, 9, 10).
#pragma once
#include "hits.cuh"

namespace stroke {
// Where stratum s samples the pixel (x, y) of a tile, relative to the tile: its centre, or a hashed place.
struct Place { real x, y; };
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
// Segments of a stratum that is kept for the backward, or of the only one.
__device__ inline Segment *segments_of(const Job &J, const Tile &p, int s) {
  return J.segments + ((J.save ? u64(s) * J.limit[RUNS] : 0) + p.run_first) * WARPS;
}

struct Sums { real r, g, b, depth, ink, clear; };
__device__ inline void composite(const Job &J, const u32 *order, u32 n, Sums &sums) {
  real T = 1;
  for (u32 k = 0; k < n; k++) {
    const Cover f = J.fragments[order[k]];
    const Piece<real> &c = J.pieces[f.piece];
    const real share = T * f.a;
    sums.r += share * c.color[0], sums.g += share * c.color[1], sums.b += share * c.color[2], sums.depth += share * f.z, sums.ink += share;
    T -= share;
  }
  sums.clear += T;
}

template <bool WORLD> __device__ void draw_tile(const Job &J) {
  const Tile p = tile_at(J, blockIdx.x);
  const int x = pixel_x(threadIdx.x), y = pixel_y(threadIdx.x), strata = samples(J);
  const bool active = x < p.w && y < p.h;
  Pool pool = {J.fragments, J.order, nullptr, J.counters + FRAGMENTS, J.counters + ORDER, J.limit[FRAGMENTS], 0, 0};
  Sums sums = {};
  for (int s = 0; s < strata; s++) {
    const Place q = place_of(J, p, s, x, y);
    pool.segments = segments_of(J, p, s);
    u32 first = 0, n = 0;
    if (p.run_first < p.run_last) n = collect<WORLD>(J, p, q.x, q.y, active, pool, first, [](const Hit &) { return true; });
    if (J.save) J.point_first[point_index(J, p, s)] = first, J.point_count[point_index(J, p, s)] = n;
    composite(J, J.order + first, n, sums);
  }
  if (!active) return;
  const real share = real(1) / strata, *bg = background_at(J, p, x, y), clear = sums.clear * share, ink = sums.ink * share;
  const u64 at = pixel_index(J, p, x, y);
  J.out_color[3 * at] = sums.r * share + clear * bg[0];
  J.out_color[3 * at + 1] = sums.g * share + clear * bg[1];
  J.out_color[3 * at + 2] = sums.b * share + clear * bg[2];
  J.out_alpha[at] = ink, J.out_depth[at] = ink > real(MIN_ALPHA) ? sums.depth / sums.ink : real(0);
}

// What the loss says of a pixel. A fragment adds T a (r, g, b) . (color - background) + T a ink + T a depth (its depth - mean) to it: as
// sum T a + T = 1, the background counts everywhere.
struct Upstream { real r, g, b, ink, depth, mean, background[3]; };
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

// Sums over the fragments of one run, by one warp, added to those of the run.
struct PixelGradient { real r, g, b, depth; };
template <bool WORLD, bool DEPTH, bool SAMPLES>
__device__ void differentiate_run(const Job &J, const Tile &p, u32 run, const Segment *segments, int s, const PixelGradient *upstream) {
  const Piece<real> &c = J.pieces[J.runs[run].piece];
  const Filter<real> filter = filter_of(J);
  const Segment mine = lane() < WARPS ? segments[lane()] : Segment{0, 0};
  u32 total;
  const u32 before = warp_prefix(__popc(mine.mask), total);
  if (!total) return;
  union { Moments<real> m; real sums[NGRAD]; } g = {};
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
    const real qx = real(p.x) - c.ox + q.x, qy = real(p.y) - c.oy + q.y;
    const Cover cover = J.fragments[f];
    const PixelGradient &u = upstream[thread];
    const real share = J.front[f] * cover.a, ga = J.g_fragment[f];
    if (SAMPLES) {
      g.m.opacity += ga;
      if (DEPTH) depth_adjoint(c, cover.tau, qx, qy, u.depth * share, g.m, real(1));
    } else fragment_adjoint<WORLD, DEPTH>(c, filter, cover.tau, qx, qy, ga, u.depth * share, g.m);
    g.m.rgb[0] += share * u.r, g.m.rgb[1] += share * u.g, g.m.rgb[2] += share * u.b;
  }
  real sum = 0;
#pragma unroll
  for (u32 k = 0; k < NGRAD; k++) {
    const real total_k = warp_sum(g.sums[k]);
    if (lane() == k) sum = total_k;
  }
  if (lane() < NGRAD) J.g_run[u64(run) * NGRAD + lane()] += sum;
}

template <bool WORLD, bool DEPTH, bool SAMPLES> __device__ void differentiate_tile(const Job &J) {
  __shared__ PixelGradient upstream[PIX];
  const Tile p = tile_at(J, blockIdx.x);
  if (p.run_first == p.run_last && !J.g_background) return;
  const int x = pixel_x(threadIdx.x), y = pixel_y(threadIdx.x), strata = samples(J);
  const Upstream u = upstream_at(J, p, x, y, real(1) / strata);
  upstream[threadIdx.x] = {u.r, u.g, u.b, u.depth};
  for (u32 k = threadIdx.x; k < (p.run_last - p.run_first) * NGRAD; k += PIX) J.g_run[u64(p.run_first) * NGRAD + k] = 0;
  real background = 0;
  for (int s = 0; s < strata; s++) {
    real clear = 1;
    const u64 at = point_index(J, p, s);
    if (p.run_first < p.run_last) differentiate_alpha(J, J.order + J.point_first[at], J.point_count[at], u, clear);
    background += clear;
    __syncthreads();
    for (u32 r = p.run_first + threadIdx.x / WARP; r < p.run_last; r += WARPS)
      differentiate_run<WORLD, DEPTH, SAMPLES>(J, p, r, segments_of(J, p, s) + u64(r - p.run_first) * WARPS, s, upstream);
    __syncthreads();
  }
  if (!J.g_background || x >= p.w || y >= p.h) return;
  real *out = J.g_background + 3 * pixel_index(J, p, x, y);
  out[0] = background * u.r, out[1] = background * u.g, out[2] = background * u.b;
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
