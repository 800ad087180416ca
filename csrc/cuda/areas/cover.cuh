// What a layer covers of each pixel of a row, by one thread; and back to the ends of its edges.
#pragma once
#include "cuda/areas/job.cuh"

namespace stroke::areas {
// A part of an array, as a list.
template <class T> struct Slice {
  T *at;
  int count;
  __device__ void push_back(const T &x) { at[count++] = x; }
  __device__ void clear() { count = 0; }
  __device__ void resize(int n) { count = n; }
  __device__ int size() const { return count; }
  __device__ T *data() { return at; }
  __device__ T &operator[](int i) { return at[i]; }
  __device__ const T &operator[](int i) const { return at[i]; }
};

// visit(edge) for all with which chains begin in a row.
template <class Visit> __device__ void each_head(const Job &J, int layer, int row, Visit visit) {
  const u32 last = J.vertex_first[J.layer_parts[layer + 1]];
  for (u32 e = J.vertex_first[J.layer_parts[layer]]; e < last; e++)
    if (J.heads[e].first <= row && row < J.heads[e].end) visit(int(e));
}

// The row's chains, and the heights at which they change. False if it has none, or there is no room.
__device__ inline bool sweep_row(const Job &J, int layer, int row, Sweep<Slice> &sweep) {
  const Polygons polygons = polygons_of(J);
  u32 pieces = 0;
  each_head(J, layer, row, [&](int e) { walk(polygons, e, row, row + 1, [&](const Piece &, int) { pieces++; }); });
  const u32 at = pieces ? take(J, PIECES, pieces) : NONE;
  if (at == NONE) return false;
  sweep.pieces = {J.pieces + at, 0}, sweep.chains = {J.chains + at, 0}, sweep.keys = {J.keys + at, 0};
  sweep.active = {J.active + at, 0}, sweep.by_left = {J.by_left + at, 0};
  each_head(J, layer, row, [&](int e) { sweep.chain(polygons, e, row, row + 1); });
  sweep.order();
  u32 heights = 2 * u32(sweep.chains.size());
  sweep.crossings([&](double) { heights++; });
  const u32 first = take(J, HEIGHTS, heights);
  if (first == NONE) return false;
  sweep.heights = {J.heights + first, 0};
  sweep.slabs();
  return true;
}

// Borders are walked along twice: to see how far they reach, and for areas.
__device__ inline Run cover_row(const Job &J, int layer, int row) {
  const Run nothing = {};
  Sweep<Slice> sweep;
  if (row < J.bounds[layer].first || row >= J.bounds[layer].end || !sweep_row(J, layer, row, sweep)) return nothing;
  const int rule = J.layers[5 * layer + 2];
  Run run = {};
  Reach reach;
  sweep.borders(rule, [&](const Border &border) { reach.add(border), run.borders++; });
  run.left = reach.left(J.width), run.right = reach.right(J.width);
  if (run.left == run.right) return nothing;
  const int count = run.right - run.left;
  run.share = take(J, SHARES, u32(count + 1));
  if (J.save)
    run.border = take(J, BORDERS, run.borders), run.sums = take(J, ROW_SUMS, u32(J.layer_sums[layer + 1] - J.layer_sums[layer] - MOVE_SUMS));
  if (run.share == NONE || run.border == NONE || run.sums == NONE) return nothing;
  double *shares = J.shares + run.share;
  for (int k = 0; k <= count; k++) shares[k] = 0;
  u32 next = run.border;
  sweep.borders(rule, [&](const Border &border) {
    if (J.save) J.borders[next++] = border;
    add_area(border, J.width, run.left, shares);
  });
  double sum = 0;
  for (int k = 0; k < count; k++) {
    sum += shares[k];
    shares[k] = clamp(sum, 0, 1);
  }
  return run;
}

// From the gradients of coverages to those of the ends of an edge: all its borders, row by row.
__device__ inline void back_to_edge(const Job &J, int e) {
  const auto [upper, lower, sign] = polygons_of(J).downwards(e);
  double g_upper[2] = {}, g_lower[2] = {};
  if (sign) {
    const Vertex &a = J.vertices[upper], &b = J.vertices[lower];
    const int layer = J.parts[a.segment].layer;
    const Span rows = rows_between(J, floor(a.y), ceil(b.y));
    for (int row = rows.first; row < rows.end; row++) {
      const Run run = run_of(J, layer, row);
      if (run.left == run.right) continue;
      for (u32 k = run.border; k < run.border + run.borders; k++)
        if (J.borders[k].edge == e) back_to_ends(J.borders[k], a, b, J.width, run.left, J.g_shares + run.share, g_upper, g_lower);
    }
  }
  for (int k = 0; k < 2; k++)
    J.g_edges[4 * e + k] = sign > 0 ? g_upper[k] : g_lower[k], J.g_edges[4 * e + 2 + k] = sign > 0 ? g_lower[k] : g_upper[k];
}
}  // namespace stroke::areas
