// From candidates to the fragments of a tile: for every point the nearest point of each stroke within reach. Included by kernel.cpp only.
#pragma once
#include "cpu/candidates.h"

namespace stroke {
namespace {
SIMD const Piece<real> &piece_of(const Job<real> &J, const Work &k, uint32_t i) { return J.pieces[k.layer[k.owner[i / VL]].piece]; }
SIMD void store_point(const Candidates &s, uint32_t i, const Point<vf> &point, vf qx, vf qy) {
  store(s.tau + i, point.tau), store(s.z + i, point.z), store(s.d2 + i, distance2(point, qx, qy));
}

// The nearest points of all candidates up to `end`. Loops over the vectors of all layers, and short ones instead of a long one: the processor then
// works on several vectors at a time.
template <int POINTS, int WIDTH> PHASE void nearest_points(const Job<real> &J, const Place &p, Work &k, uint32_t end) {
  const Candidates s = candidates(k);
  for (uint32_t i = 0; i < end; i += VL) {
    const Piece<real> &c = piece_of(J, k, i);
    vf qx, qy;
    points_of<POINTS, WIDTH>(k, p, c, load(k.px + i) & (PIX - 1), qx, qy);
    const Approach<vf> step = newton_step(c, load(s.from + i), qx, qy);
    store(s.tau + i, step.tau), store(s.d2 + i, step.d2), store(s.rate + i, step.rate);
    store(s.qx + i, qx), store(s.qy + i, qy);
  }
  for (uint32_t i = 0; i < end; i += VL) {
    const vf qx = load(s.qx + i), qy = load(s.qy + i);
    const Approach<vf> step = {.from = load(s.from + i), .d2 = load(s.d2 + i), .tau = load(s.tau + i), .rate = load(s.rate + i)};
    store_point(s, i, arrive(piece_of(J, k, i), step, qx, qy, load(k.px + i) >= 0), qx, qy);
  }
}

// The same where most strokes are smooth: all steps on parabolas first, then those of the few vectors where more is needed, listed in k.order, with
// what their first step was in place of points.
template <int POINTS, int WIDTH> PHASE void nearest_smooth_points(const Job<real> &J, const Place &p, Work &k, uint32_t end) {
  const Candidates s = candidates(k);
  real *const bent_d2 = s.qx, *const bent_rate = s.qy;
  uint32_t bends = 0;
  for (uint32_t i = 0; i < end; i += VL) {
    const Piece<real> &c = piece_of(J, k, i);
    const vi px = load(k.px + i);
    vf qx, qy;
    points_of<POINTS, WIDTH>(k, p, c, px & (PIX - 1), qx, qy);
    Approach<vf> a;
    vi bent;
    store_point(s, i, two_steps(c, load(s.from + i), qx, qy, a, bent), qx, qy);
    store(bent_d2 + bends * VL, a.d2), store(bent_rate + bends * VL, a.rate);
    k.order[bends] = i, bends += any(bent & (px >= 0));
  }
  for (uint32_t b = 0; b < bends; b++) {
    const uint32_t i = k.order[b];
    const Piece<real> &c = piece_of(J, k, i);
    const vi px = load(k.px + i);
    vf qx, qy;
    points_of<POINTS, WIDTH>(k, p, c, px & (PIX - 1), qx, qy);
    const Approach<vf> a = {.from = load(s.from + i), .d2 = load(bent_d2 + b * VL), .tau = load(s.tau + i), .rate = load(bent_rate + b * VL)};
    store_point(s, i, more_steps(c, a, qx, qy, px >= 0), qx, qy);
  }
}

// Coverage and depth at the nearest points of all candidates up to `end`; the covered ones stay as fragments, and of points on outlines all where
// widths change along strokes. Returns their number.
template <int POINTS, int WIDTH> PHASE uint32_t cover(const Job<real> &J, const Place &p, Work &k, uint32_t end) {
  const Filter<real> filter = J.filter;
  const Candidates s = candidates(k);
  uint32_t n = 0;
  for (uint32_t i = 0; i < end; i += VL) {
    const uint32_t l = k.owner[i / VL];
    const Piece<real> &c = J.pieces[k.layer[l].piece];
    const vi px = load(k.px + i);
    const vf tau = load(s.tau + i);
    vf qx = {}, qy = {};
    if (c.oblong) points_of<POINTS, WIDTH>(k, p, c, px & (PIX - 1), qx, qy);
    const Fragment<vf> g = fragment_at<WIDTH>(c, filter, tau, load(s.z + i), sqrt(load(s.d2 + i)), qx, qy);
    // Monte Carlo: a point is inside or not.
    const vf a = J.strata ? select(g.d < g.r, splat(1), vf{}) : g.coverage;
    const vi in = (POINTS == ANYWHERE && WIDTH != EVEN ? px >= 0 : a > real(0)) & (g.depth > J.min_depth) & (px >= 0);
    const Mask m = bits(in);
    compress_store(k.t + n, tau, m), compress_store(k.a + n, a * c.opacity, m);
    compress_store(k.z + n, g.depth, m), compress_store(k.px + n, px, m);
    k.first[l + 1] = n += count(m);
  }
  return n;
}

// Drops layers without fragments, and finds the nearest and the farthest depth of the others.
PHASE void close_layers(Work &k) {
  uint32_t kept = 0;
  for (uint32_t l = 0; l < k.layers; l++) {
    const uint32_t start = k.first[kept], stop = k.first[l + 1];
    if (start == stop) continue;
    vf near = splat(real(1e30)), far = vf{};
    for (uint32_t f = start; f < stop; f += VL) {
      const vf z = load(k.z + f);
      const vi in = iota() < splat_int(integer(stop - f));
      near = min(near, select(in, z, near)), far = max(far, select(in, z, far));
    }
    k.layer[kept] = {k.layer[l].piece, k.layer[l].slot, least(near), most(far)}, k.first[++kept] = stop;
  }
  k.layers = kept;
}

// All fragments of the tile's strokes, in the order of strokes. Returns their number.
template <int POINTS, int WIDTH> SIMD uint32_t collect(const Job<real> &J, int tile, const Place &p, Work &k) {
  k.layers = 0;
  reserve_layers(k, 1);
  k.first[0] = 0;
  uint32_t n = 0, smooth = 0;
  const Intersection *const last = J.intersections + J.tile_first[tile + 1];
  for (const Intersection *e = J.intersections + J.tile_first[tile], *end; e < last; e = end) {
    for (end = e + 1; end < last && end->stroke == e->stroke;) end++;
    const Intersection &intersection = *e, &next = *end;
    const bool single = end == e + 1;
    __builtin_prefetch(J.chords + next.first), __builtin_prefetch(J.pieces + next.piece), __builtin_prefetch((char *)(J.pieces + next.piece) + 64);
    const real R = J.reach[intersection.stroke];
    if constexpr (POINTS != ANYWHERE)
      if (single && intersection.smooth) {
        reserve(k, n, n + PIX);
        const uint32_t packed = pack_rows<POINTS>(J, intersection.first, intersection.last, p, k, n, R);
        start_along<POINTS>(J, intersection.first, intersection.last, p, k, n, packed);
        smooth += packed - n, n = add_layer(k, intersection.piece, intersection.slot, n, packed);
        continue;
      }
    reserve(k, n, n + 4 * PIX);  // a point may have four starts
    if (single && intersection.pieces == 1) n = bent_candidates<POINTS, WIDTH>(J, intersection, p, k, n, R);
    else n = candidates_of_pieces<POINTS, WIDTH>(J, e, end, p, k, n, R);
  }
  if (2 * smooth > n) nearest_smooth_points<POINTS, WIDTH>(J, p, k, n);
  else nearest_points<POINTS, WIDTH>(J, p, k, n);
  n = cover<POINTS, WIDTH>(J, p, k, n);
  close_layers(k);
  return n;
}
}  // namespace
}  // namespace stroke
