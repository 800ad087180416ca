// The points on the outlines of all strokes, by piece and by tile (Monte Carlo). Included by driver.cpp only.
#pragma once
#include "common/outline.h"
#include "cpu/driver.h"
#include <algorithm>

namespace stroke {
namespace {
// Where the points of every outline lie, by piece and by tile.
template <class S> struct Outlines {
  Buffer<OutlinePoint<S>> points;
  Buffer<uint32_t> piece_first, order, tile_first;
  Buffer<S> gradient;
};
template <class S> Outlines<S> sample_outlines(const State<S> &st) {
  const Job<S> &J = st.job;
  const size_t pieces = st.flat.pieces.size(), tiles = size_t(J.views) * J.tiles_x * J.tiles_y;
  const OutlineSampler<S, Flat<S>> sampler(st.flat, J.world, J.along, J.strata, J.seed);
  auto tile_of = [&](const OutlinePoint<S> &o) -> int64_t {
    if (!(o.x >= 0 && o.y >= 0 && o.x < J.width && o.y < J.height)) return -1;
    return (int64_t(seen_in(st.input.layout, STROKES, st.piece_stroke[o.piece]).view) * J.tiles_y + int(o.y) / TILE) * J.tiles_x + int(o.x) / TILE;
  };
  Outlines<S> out;
  out.piece_first = Buffer<uint32_t>(pieces + 1), out.tile_first = Buffer<uint32_t>(tiles + 1);
  uint32_t *first = out.piece_first.get();
  first[pieces] = 0;
  threads().run(int(pieces), 8, [&](int p, int) {
    first[p] = 0;
    sampler.piece(uint32_t(p), [&](uint32_t, const OutlinePoint<S> &o) { first[p] += tile_of(o) >= 0; });
  });
  uint64_t total = 0;
  for (size_t p = 0; p <= pieces; p++) {
    const uint64_t n = std::exchange(first[p], uint32_t(total));
    if ((total += n) > UINT32_MAX) throw std::bad_alloc();
  }
  out.points = Buffer<OutlinePoint<S>>(total + 1), out.order = Buffer<uint32_t>(total + 1), out.gradient = Buffer<S>(total + 1);
  threads().run(int(pieces), 8, [&](int p, int) {
    uint32_t at = first[p];
    sampler.piece(uint32_t(p), [&](uint32_t, const OutlinePoint<S> &o) {
      if (tile_of(o) >= 0) out.points[at++] = o;
    });
  });
  uint32_t *tile = out.tile_first.get(), sum = 0;
  std::fill_n(tile, tiles + 1, 0);
  for (uint32_t i = 0; i < total; i++) tile[tile_of(out.points[i])]++;
  for (size_t t = 0; t <= tiles; t++) sum += std::exchange(tile[t], sum);
  for (uint32_t i = 0; i < total; i++) out.order[tile[tile_of(out.points[i])]++] = i;
  for (size_t t = tiles; t > 0; t--) tile[t] = tile[t - 1];
  tile[0] = 0;
  return out;
}
}  // namespace
}  // namespace stroke
