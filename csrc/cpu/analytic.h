// Analytic antialiasing: coverage by distance at the pixel centre (docs/explanation/mathematics.md, eq. 7). Included by kernel.cpp only.
#pragma once
#include "cpu/backward.h"

namespace stroke {
namespace {
template <int WIDTH> void analytic_forward(const Job<real> &J, int tile, Scratch &S, Arena &A) {
  const Place p = place_of(J, tile);
  if (J.tile_first[tile] == J.tile_first[tile + 1]) {
    if (J.save) J.tiles[tile] = {};
    return write_empty(J, p);
  }
  Work &k = work(S);
  const uint32_t n = collect<GRID, WIDTH>(J, tile, p, k);
  const uint32_t sorted = sort_layers(k);
  if (sorted == k.layers) blend_layers(J, k);
  else sort_fragments(k, sorted), transmit(k, n), composite(J, k);
  write_tile(J, p, k);
  if (J.save) save_tile(J.tiles[tile], k, n, sorted == k.layers, A);
}

template <int WIDTH, bool DEPTH> void analytic_backward(const Job<real> &J, int tile, Scratch &S) {
  const Tile &t = J.tiles[tile];
  clear_slots(J, tile);
  if (t.fragments == 0 && !J.g_background) return;
  Ahead ahead(J, tile);
  const Place p = place_of(J, tile);
  const Filter<real> filter = J.filter;
  Work &k = work(S);
  reserve(k, 0, t.fragments);
  const v4 plain = load_upstream(J, p, k, 1);
  const real *tau = (const real *)t.tau, *T = (const real *)t.T, *a = (const real *)t.a;
  for (uint32_t l = 0; DEPTH && l < t.layers; l++) {
    const Piece<real> c = J.pieces[t.piece[l]];
    for (uint32_t f = t.first[l]; f < t.first[l + 1]; f += VL) store(k.z + f, depth_at(c, load(tau + f), cubic(c.z, load(tau + f))));
  }
  differentiate_alpha(J, t, k, plain);
  if (J.g_background) background_gradient(J, p, t, k, false);
  for (uint32_t l = 0; l < t.layers; l++) {
    const Piece<real> c = J.pieces[t.piece[l]];
    Moments<vf> m = {};
    for (uint32_t f = t.first[l]; f < t.first[l + 1]; f += VL) {
      ahead.some();
      const vi px = widen(t.pixel + f), in = iota() < splat_int(integer(t.first[l + 1] - f));
      vf qx, qy, gz = {};
      points_of<GRID, WIDTH>(k, p, c, px, qx, qy);
      if (DEPTH) {
        for (int i = 0; i < VL; i++) gz[i] = k.pix[px[i]][3];
        gz = select(in, gz * load(T + f) * load(a + f), vf{});
      }
      fragment_adjoint<WIDTH, DEPTH>(c, filter, select(in, load(tau + f), vf{}), qx, qy, select(in, load(k.g + f), vf{}), gz, m);
    }
    add_to_slot<WIDTH>(J, t.slot[l], m, color_gradient(t, k, l));
  }
}
}  // namespace
}  // namespace stroke
