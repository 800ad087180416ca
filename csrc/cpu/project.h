// Projection of strokes through cameras and back on the CPU: the loops; the mathematics are in common/project.h.
#pragma once
#include "common/layout.h"
#include "common/project.h"
#include "cpu/threads.h"
#include <cstddef>

namespace stroke {

template <class S> struct Scene {
  Layout layout;
  int controls;
  const S *points, *weights;  // (segments, controls, 3), (segments, controls)
  const double *matrices;     // (views, 4, 4)
  const S *points_of(int n) const { return points + size_t(n) * controls * 3; }
  const S *weights_of(int n) const { return weights + size_t(n) * controls; }
};

// cubics: (rows of segments, 4, 4).
template <class S> void project(const Scene<S> &s, double *cubics) {
  threads().run(s.layout.segments, 256, [&](int n, int) {
    double h[16];
    control_of(s.points_of(n), s.weights_of(n), s.controls, h);
    const Rows rows = rows_of(s.layout, SEGMENTS, n);
    for (int v = rows.first_view; v < rows.end_view; v++) to_view(s.matrices + 16 * v, h, cubics + 16 * size_t(rows.at(v)));
  });
}

// Gradients from that of the cubics; g_matrices may be null. Sums run over views, and over segments, in order.
template <class S> void project_backward(const Scene<S> &s, const double *g_cubics, S *g_points, S *g_weights, double *g_matrices) {
  threads().run(s.layout.segments, 256, [&](int n, int) {
    double g[16] = {};
    const Rows rows = rows_of(s.layout, SEGMENTS, n);
    for (int v = rows.first_view; v < rows.end_view; v++) from_view(s.matrices + 16 * v, g_cubics + 16 * size_t(rows.at(v)), g);
    const size_t at = size_t(n) * s.controls;
    from_control(s.points_of(n), s.weights_of(n), s.controls, g, g_points + 3 * at, g_weights + at);
  });
  if (!g_matrices) return;
  threads().run(s.layout.views, 1, [&](int v, int) {
    double sum[16] = {}, h[16];
    const SegmentsSeen seen = segments_of(s.layout, v);
    for (int n = seen.first; n < seen.end; n++) {
      control_of(s.points_of(n), s.weights_of(n), s.controls, h);
      to_matrix(h, g_cubics + 16 * (size_t(seen.first_row) + n - seen.first), sum);
    }
    for (int k = 0; k < 16; k++) g_matrices[16 * v + k] = sum[k];
  });
}
}  // namespace stroke
