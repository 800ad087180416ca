// From gradients of edges and rows to those of what was given: each sum by one thread or warp, in an order of its own.
#pragma once
#include "cuda/areas/job.cuh"

namespace stroke::areas {
// Of a segment's control points and transform: over its vertices, which it has written itself, or the joint of the segment behind it. By one warp.
__device__ inline void sum_part(const Job &J, int j) {
  const Part &part = J.parts[j];
  const Segment segment = segment_of(J, j);
  const Matrix matrix = matrix_of(J, part.layer);
  double sums[PART_SUMS] = {};
  auto add_vertices = [&](int of) {
    for (u32 v = J.vertex_first[of] + lane(); v < J.vertex_first[of + 1]; v += WARP) {
      const Vertex &vertex = J.vertices[v];
      if (vertex.segment != j) continue;
      const Link link = J.links[v];
      Point g = {0, 0};
      if (link.next >= 0) g = g + Point{J.g_edges[4 * v], J.g_edges[4 * v + 1]};
      if (link.previous >= 0) g = g + Point{J.g_edges[4 * link.previous + 2], J.g_edges[4 * link.previous + 3]};
      back_to_controls(vertex, segment, matrix, g, sums, sums + CONTROL_SUMS);
    }
  };
  add_vertices(j);
  if (J.layers[5 * part.layer + 2] == STROKE && segment.reach() > 0) {
    int behind = j;
    do behind = behind + 1 < part.first + part.count ? behind + 1 : part.first;
    while (!(segment_of(J, behind).reach() > 0));
    if (behind != j) add_vertices(behind);
  }
  for (int k = 0; k < PART_SUMS; k++) {
    const double total = warp_sum(sums[k]);
    if (lane() == 0) J.part_sums[u64(j) * PART_SUMS + k] = total;
  }
}
// Of a layer's transform and paint, by one warp.
__device__ inline void sum_layer(const Job &J, int layer) {
  const int first = J.layer_sums[layer], count = J.layer_sums[layer + 1] - first;
  for (int k = int(lane()); k < count; k += WARP) {
    double sum = 0;
    if (k < MOVE_SUMS)
      for (int j = J.layer_parts[layer]; j < J.layer_parts[layer + 1]; j++) sum += J.part_sums[u64(j) * PART_SUMS + CONTROL_SUMS + k];
    else
      for (int row = J.bounds[layer].first; row < J.bounds[layer].end; row++) {
        const Run run = run_of(J, layer, row);
        if (run.left < run.right) sum += J.row_sums[run.sums + k - MOVE_SUMS];
      }
    J.layer_totals[first + k] = sum;
  }
}

__device__ inline void finish_point(const Job &J, u32 point) {
  double sums[3] = {};
  for (int i = J.point_first[point]; i < J.point_first[point + 1]; i++) {
    const double *g = J.part_sums + u64(J.uses[i] / 4) * PART_SUMS + 3 * (J.uses[i] % 4);
    for (int k = 0; k < 3; k++) sums[k] += g[k];
  }
  J.g_points[2 * point] = real(sums[0]), J.g_points[2 * point + 1] = real(sums[1]), J.g_half_widths[point] = real(sums[2]);
}
// visit(layer, its paint, the sums of that) for all layers.
template <class Visit> __device__ void each_paint(const Job &J, Visit visit) {
  const Tables<real> tables = tables_of(J);
  for (int layer = 0; layer < J.layer_count; layer++)
    visit(layer, Paint<real>(tables, J.layers[5 * layer + 4]), J.layer_totals + J.layer_sums[layer] + MOVE_SUMS);
}
__device__ inline void finish_transform(const Job &J, u32 i) {
  const int row = int(i / 6), k = int(i % 6);
  double sum = 0;
  each_paint(J, [&](int layer, const Paint<real> &paint, const double *sums) {
    if (J.layers[5 * layer + 3] == row) sum += sums[k - MOVE_SUMS];
    if (!paint.plain() && paint.transform == row) sum += sums[5 * paint.stops + 4 + k];
  });
  J.g_transforms[i] = real(sum);
}
__device__ inline void finish_axis(const Job &J, u32 i) {
  double sum = 0;
  each_paint(J, [&](int, const Paint<real> &paint, const double *sums) {
    if (!paint.plain() && paint.row == int(i / 4)) sum += sums[5 * paint.stops + i % 4];
  });
  J.g_axes[i] = real(sum);
}
__device__ inline void finish_stop(const Job &J, u32 stop) {
  double color[4] = {}, offset = 0;
  each_paint(J, [&](int, const Paint<real> &paint, const double *sums) {
    const int i = int(stop) - paint.first;
    if (i < 0 || i >= (paint.plain() ? 1 : paint.stops)) return;
    for (int k = 0; k < 4; k++) color[k] += sums[4 * i + k];
    if (!paint.plain()) offset += sums[4 * paint.stops + i];
  });
  for (int k = 0; k < 4; k++) J.g_colors[4 * stop + k] = real(color[k]);
  J.g_offsets[stop] = real(offset);
}
}  // namespace stroke::areas
