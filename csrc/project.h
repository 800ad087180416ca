// Projection of strokes through cameras and back: the same as diff3ds/project.py, without the cost of ten tensor operations.
#pragma once
#include "threads.h"
#include <cstddef>

namespace stroke {

// From K control points to the four of the same curve as a cubic, in homogeneous coordinates.
inline const double *elevation(int K) {
  static const double line[16] = {1, 0, 2 / 3., 1 / 3., 1 / 3., 2 / 3., 0, 1};
  static const double quadratic[16] = {1, 0, 0, 1 / 3., 2 / 3., 0, 0, 2 / 3., 1 / 3., 0, 0, 1};
  static const double cubic[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  return K == 2 ? line : K == 3 ? quadratic : cubic;
}

template <class S> struct Scene {
  int views, strokes, controls;
  const S *points, *weights;   // (strokes, controls, 3), (strokes, controls)
  const double *matrices;      // (views, 4, 4)
  // Homogeneous control points of a stroke as a cubic.
  void control(int n, double *out) const {
    const double *raise = elevation(controls);
    for (int i = 0; i < 16; i++) out[i] = 0;
    for (int k = 0; k < controls; k++) {
      const size_t at = size_t(n) * controls + k;
      const double w = weights[at], p[4] = {points[3 * at] * w, points[3 * at + 1] * w, points[3 * at + 2] * w, w};
      for (int i = 0; i < 4; i++)
        for (int c = 0; c < 4; c++) out[4 * i + c] += raise[i * controls + k] * p[c];
    }
  }
};

// cubics: (views, strokes, 4, 4).
template <class S> void project(const Scene<S> &s, double *cubics) {
  threads().run(s.strokes, 256, [&](int n, int) {
    double h[16];
    s.control(n, h);
    for (int v = 0; v < s.views; v++) {
      const double *m = s.matrices + 16 * v;
      double *out = cubics + (size_t(v) * s.strokes + n) * 16;
      for (int i = 0; i < 4; i++)
        for (int c = 0; c < 4; c++) {
          double sum = 0;
          for (int j = 0; j < 4; j++) sum += m[4 * c + j] * h[4 * i + j];
          out[4 * i + c] = sum;
        }
    }
  });
}

// Gradients from that of the cubics; g_matrices may be null. Sums run over views, and over strokes, in order.
template <class S> void project_backward(const Scene<S> &s, const double *g_cubics, S *g_points, S *g_weights, double *g_matrices) {
  const double *raise = elevation(s.controls);
  threads().run(s.strokes, 256, [&](int n, int) {
    double gh[16] = {};
    for (int v = 0; v < s.views; v++) {
      const double *m = s.matrices + 16 * v, *g = g_cubics + (size_t(v) * s.strokes + n) * 16;
      for (int i = 0; i < 4; i++)
        for (int c = 0; c < 4; c++)
          for (int j = 0; j < 4; j++) gh[4 * i + j] += g[4 * i + c] * m[4 * c + j];
    }
    for (int k = 0; k < s.controls; k++) {
      const size_t at = size_t(n) * s.controls + k;
      double gp[4] = {};
      for (int i = 0; i < 4; i++)
        for (int c = 0; c < 4; c++) gp[c] += raise[i * s.controls + k] * gh[4 * i + c];
      double gw = gp[3];
      for (int c = 0; c < 3; c++) g_points[3 * at + c] = S(gp[c] * s.weights[at]), gw += gp[c] * s.points[3 * at + c];
      g_weights[at] = S(gw);
    }
  });
  if (!g_matrices) return;
  threads().run(s.views, 1, [&](int v, int) {
    double sum[16] = {}, h[16];
    for (int n = 0; n < s.strokes; n++) {
      s.control(n, h);
      const double *g = g_cubics + (size_t(v) * s.strokes + n) * 16;
      for (int i = 0; i < 4; i++)
        for (int c = 0; c < 4; c++)
          for (int j = 0; j < 4; j++) sum[4 * c + j] += g[4 * i + c] * h[4 * i + j];
    }
    for (int k = 0; k < 16; k++) g_matrices[16 * v + k] = sum[k];
  });
}
}  // namespace stroke
