// Monte Carlo antialiasing, the paper's estimator: stratified samples, and the Reynolds term on outlines (docs/explanation/mathematics.md, eq. 10-12).
// Included by kernel.cpp only.
#pragma once
#include "common/outline.h"
#include "cpu/backward.h"

namespace stroke {
namespace {
// The sample of stratum s in every pixel of the tile: k.x, k.y, relative to the tile.
PHASE void place_samples(const Job<real> &J, const Place &p, int s, Work &k) {
  const int n = J.strata;
  const uint32_t base = mix(uint32_t(J.seed) ^ mix(uint32_t(J.seed >> 32) ^ mix(uint32_t(p.view * n * n + s))));
  const float sx = float(s % n), sy = float(s / n), step = 1 / float(n);
  for (int y = 0; y < TILE; y++) {
    const uint32_t row = uint32_t(p.y + y) * uint32_t(J.width) + uint32_t(p.x);
    for (int x = 0; x < TILE; x++) {
      const uint32_t u = mix(base ^ (row + uint32_t(x))), v = mix(u ^ 0x9e3779b9u);
      k.x[y * TILE + x] = real(float(x) + (sx + unit(u)) * step), k.y[y * TILE + x] = real(float(y) + (sy + unit(v)) * step);
    }
  }
}

template <int WIDTH> void montecarlo_forward(const Job<real> &J, int tile, Scratch &S, Arena &A) {
  const Place p = place_of(J, tile);
  const int strata = J.strata * J.strata;
  if (J.tile_first[tile] == J.tile_first[tile + 1]) {
    for (int s = 0; s < strata && J.save; s++) J.tiles[size_t(tile) * strata + s] = {};
    return write_empty(J, p);
  }
  Work &k = work(S);
  v4 total[PIX] = {};
  alignas(64) real clear[PIX] = {}, ink[PIX] = {};
  for (int s = 0; s < strata; s++) {
    place_samples(J, p, s, k);
    const uint32_t n = collect<NEAR_GRID, WIDTH>(J, tile, p, k);
    const uint32_t sorted = sort_layers(k);
    sort_fragments(k, sorted);
    transmit(k, n);
    composite(J, k);
    for (int i = 0; i < PIX; i++) total[i] += k.pix[i];
    for (int i = 0; i < PIX; i += VL) store(clear + i, load(clear + i) + load(k.run + i)), store(ink + i, load(ink + i) + load(k.ink + i));
    if (J.save) save_tile(J.tiles[size_t(tile) * strata + s], k, n, sorted == k.layers, A);
  }
  const real per_sample = real(1) / strata;
  for (int i = 0; i < PIX; i++) k.pix[i] = total[i] * per_sample;
  for (int i = 0; i < PIX; i += VL) store(k.run + i, load(clear + i) * per_sample), store(k.ink + i, load(ink + i) * per_sample);
  write_tile(J, p, k);
}

// The interior term: colour, opacity, background, and what moves with the depth of a hit.
template <int OBLONG_OR_EVEN> void montecarlo_backward(const Job<real> &J, int tile, Scratch &S) {
  const Place p = place_of(J, tile);
  const int strata = J.strata * J.strata;
  Work &k = work(S);
  clear_slots(J, tile);
  for (int s = 0; s < strata; s++) {
    const Tile &t = J.tiles[size_t(tile) * strata + s];
    if (t.fragments == 0 && !J.g_background) continue;
    reserve(k, 0, t.fragments);
    const v4 plain = load_upstream(J, p, k, real(1) / strata);
    if (J.g_depth) place_samples(J, p, s, k);
    const real *tau = (const real *)t.tau, *T = (const real *)t.T;
    for (uint32_t l = 0; J.g_depth && l < t.layers; l++) {
      const Piece<real> &c = J.pieces[t.piece[l]];
      for (uint32_t f = t.first[l]; f < t.first[l + 1]; f++) k.z[f] = depth_at(c, tau[f], cubic(c.z, tau[f]));
    }
    differentiate_alpha(J, t, k, plain);
    if (J.g_background) background_gradient(J, p, t, k, s > 0);
    for (uint32_t l = 0; l < t.layers; l++) {
      const Piece<real> c = J.pieces[t.piece[l]];
      Moments<vf> m = {};
      for (uint32_t f = t.first[l]; f < t.first[l + 1]; f += VL) {
        const vi in = iota() < splat_int(integer(t.first[l + 1] - f));
        m.opacity += select(in, load(k.g + f), vf{});
        if (!J.g_depth) continue;
        const vi px = widen(t.pixel + f);
        vf qx, qy, gz;
        points_of<NEAR_GRID, OBLONG_OR_EVEN>(k, p, c, px, qx, qy);
        for (int i = 0; i < VL; i++) gz[i] = k.pix[px[i]][3];
        depth_adjoint<OBLONG_OR_EVEN>(c, select(in, load(tau + f), vf{}), qx, qy, select(in, gz * load(T + f) * c.opacity, vf{}), vf{}, m, real(1));
      }
      add_to_slot<EVEN>(J, t.slot[l], m, color_gradient(t, k, l));
    }
  }
}

// dL per unit of normal displacement at the outline points in a tile: the value just inside less the value just outside, times the length
// that the point stands for. Points that lie inside another part of their own stroke, or nearer to a thinner one, are no outline.
template <int WIDTH> void outline_values(const Job<real> &J, int tile, Scratch &S) {
  const Place p = place_of(J, tile);
  Work &k = work(S);
  alignas(64) real x[PIX], y[PIX];
  v4 seen[PIX];
  real ink[PIX], mean[PIX], background[PIX], own_depth[PIX], front[PIX], behind[PIX], clear[PIX];
  uint32_t own[PIX];
  bool hidden[PIX];
  for (uint32_t i0 = J.outline_first[tile]; i0 < J.outline_first[tile + 1]; i0 += PIX) {
    const uint32_t rest = J.outline_first[tile + 1] - i0, n = rest < PIX ? rest : PIX;
    // Upstream values are those of the pixel that a point lies in.
    const v4 plain = load_upstream(J, p, k, 1);
    for (uint32_t i = 0; i < PIX; i++) {
      const OutlinePoint<real> &o = J.outline[J.outline_order[i0 + (i < n ? i : 0)]];
      const Piece<real> &c = J.pieces[o.piece];
      x[i] = o.x - p.x, y[i] = o.y - p.y;
      const int pixel = int(y[i]) * TILE + int(x[i]);
      seen[i] = k.pix[pixel], ink[i] = k.ink[pixel], mean[i] = k.depth[pixel], background[i] = k.behind[pixel];
      own[i] = J.piece_stroke[o.piece], own_depth[i] = depth_at(c, o.tau, cubic(c.z, o.tau));
      front[i] = clear[i] = 1, behind[i] = 0, hidden[i] = false;
    }
    std::memcpy(k.x, x, sizeof x), std::memcpy(k.y, y, sizeof y);
    const uint32_t fragments = collect<ANYWHERE, WIDTH>(J, tile, p, k);
    for (uint32_t l = 0; l < k.layers; l++) {
      const Piece<real> &c = J.pieces[k.layer[l].piece];
      const uint32_t stroke = J.piece_stroke[k.layer[l].piece];
      for (uint32_t f = k.first[l]; f < k.first[l + 1]; f++) {
        const integer i = k.px[f];
        if (own[i] != stroke) continue;
        const Point<real> point = point_at(c, k.t[f]);
        real qx = k.x[i] + (p.x - c.ox), qy = k.y[i] + (p.y - c.oy);
        to_square<WIDTH>(c, qx, qy);
        const real d2 = distance2(point, qx, qy);
        const Fragment<real> g = fragment<WIDTH>(c, J.filter, point.tau, point.z, sqrt(d2));
        if (g.r - g.d > real(OUTLINE_SLACK) || (WIDTH != EVEN && g.d - g.r > real(OUTLINE_GAP))) hidden[i] = true;
        k.a[f] = 0;
      }
    }
    sort_fragments(k, sort_layers(k));
    real *const values = k.g, *const in_front = k.T;  // no gradient and no transmittance is taken here
    // Fragment to layer, for the colour: layers hold runs of fragments.
    for (uint32_t l = 0; l < k.layers; l++) {
      const Piece<real> &c = J.pieces[k.layer[l].piece];
      const v4 color = color_of(c) - plain;
      for (uint32_t f = k.first[l]; f < k.first[l + 1]; f++) {
        v4 with_depth = color;
        const integer i = k.px[f];
        with_depth[3] = k.z[f] - mean[i];
        const v4 q = seen[i] * with_depth;
        values[f] = (q[0] + q[1]) + (q[2] + q[3]) + ink[i];
        in_front[f] = k.z[f] < own_depth[i] || (k.z[f] == own_depth[i] && J.piece_stroke[k.layer[l].piece] > own[i]) ? 1 : 0;
      }
    }
    for (uint32_t j = 0; j < fragments; j++) {
      const uint32_t f = k.order[j];
      const integer i = k.px[f];
      if (in_front[f] > 0) front[i] *= 1 - k.a[f];
      else behind[i] += clear[i] * k.a[f] * values[f], clear[i] *= 1 - k.a[f];
    }
    for (uint32_t i = 0; i < n; i++) {
      const OutlinePoint<real> &o = J.outline[J.outline_order[i0 + i]];
      const Piece<real> &c = J.pieces[o.piece];
      v4 color = color_of(c) - plain;
      color[3] = own_depth[i] - mean[i];
      const v4 q = seen[i] * color;
      const real value = (q[0] + q[1]) + (q[2] + q[3]) + ink[i];
      const real jump = front[i] * c.opacity * (value - behind[i] - clear[i] * background[i]);
      J.g_outline[J.outline_order[i0 + i]] = hidden[i] ? 0 : jump * o.dtau;
    }
  }
}

// Sums over the outline points of one piece, in their order.
void outline_piece(const Job<real> &J, uint32_t piece, uint32_t first, uint32_t last, real *sums) {
  const Piece<real> c = J.pieces[piece];
  Moments<real> m = {};
  static_assert(sizeof m == NSUMS * sizeof(real));
  for (uint32_t i = first; i < last; i++) {
    const OutlinePoint<real> &o = J.outline[i];
    const real g = J.g_outline[i];
    if (g == 0) continue;
    with_width(J.world, J.along, J.oblong, [&](auto width) { outline_adjoint<width>(c, o.tau, o.ux, o.uy, o.along, o.slope, g, m); });
  }
  std::memcpy(sums, &m, sizeof m);
}
}  // namespace
}  // namespace stroke
