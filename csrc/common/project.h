// Projection of one stroke through one camera and back, shared by every driver: the same as diff3ds/project.py, without the cost of ten tensor
// operations. Homogeneous control points are 4 x (x, y, z, w), in space or in a view.
#pragma once
#include "common/scalar.h"

namespace stroke {

// Weight of control point k of K in control point i of the same curve as a cubic.
template <int K> HD constexpr double elevation(int i, int k) {
  constexpr double line[4][2] = {{1, 0}, {2 / 3., 1 / 3.}, {1 / 3., 2 / 3.}, {0, 1}};
  constexpr double quadratic[4][3] = {{1, 0, 0}, {1 / 3., 2 / 3., 0}, {0, 2 / 3., 1 / 3.}, {0, 0, 1}};
  if constexpr (K == 2) return line[i][k];
  else if constexpr (K == 3) return quadratic[i][k];
  else return double(i == k);
}

template <int K, class S> HD void elevate(const S *points, const S *weights, double *out) {
  for (int i = 0; i < 16; i++) out[i] = 0;
  for (int k = 0; k < K; k++) {
    const double w = weights[k], p[4] = {points[3 * k] * w, points[3 * k + 1] * w, points[3 * k + 2] * w, w};
    for (int i = 0; i < 4; i++)
      for (int c = 0; c < 4 && elevation<K>(i, k) != 0; c++) out[4 * i + c] += elevation<K>(i, k) * p[c];
  }
}
// A stroke with K control points (K, 3) and weights (K) as a cubic.
template <class S> HD void control_of(const S *points, const S *weights, int K, double *out) {
  if (K == 2) elevate<2>(points, weights, out);
  else if (K == 3) elevate<3>(points, weights, out);
  else elevate<4>(points, weights, out);
}
// The matrix of a camera with this pose (4, 4) and these intrinsics (3, 3), as Cameras.projection of camera.py has it.
template <class S> HD void matrix_of(const S *pose, const S *intrinsics, bool orthographic, double *out) {
  // Without perspective weight and depth trade places.
  const int rows[4] = {0, 1, orthographic ? 3 : 2, orthographic ? 2 : 3};
  for (int c = 0; c < 4; c++) {
    for (int i = 0; i < 3; i++) {
      double sum = 0;
      for (int k = 0; k < 3; k++) sum += double(intrinsics[3 * i + k]) * pose[4 * rows[k] + c];
      out[4 * i + c] = sum;
    }
    out[12 + c] = pose[4 * rows[3] + c];
  }
}
// As a camera with this matrix (4, 4) sees it.
HD void to_view(const double *matrix, const double *control, double *out) {
  for (int i = 0; i < 4; i++)
    for (int c = 0; c < 4; c++) {
      double sum = 0;
      for (int j = 0; j < 4; j++) sum += matrix[4 * c + j] * control[4 * i + j];
      out[4 * i + c] = sum;
    }
}

// Adds a view's gradient to that of the control in space ...
HD void from_view(const double *matrix, const double *g, double *g_control) {
  for (int i = 0; i < 4; i++)
    for (int c = 0; c < 4; c++)
      for (int j = 0; j < 4; j++) g_control[4 * i + j] += g[4 * i + c] * matrix[4 * c + j];
}
// ... and to that of the matrix.
HD void to_matrix(const double *control, const double *g, double *g_matrix) {
  for (int i = 0; i < 4; i++)
    for (int c = 0; c < 4; c++)
      for (int j = 0; j < 4; j++) g_matrix[4 * c + j] += g[4 * i + c] * control[4 * i + j];
}
template <int K, class S> HD void lower(const S *points, const S *weights, const double *g_control, S *g_points, S *g_weights) {
  for (int k = 0; k < K; k++) {
    double g[4] = {};
    for (int i = 0; i < 4; i++)
      for (int c = 0; c < 4 && elevation<K>(i, k) != 0; c++) g[c] += elevation<K>(i, k) * g_control[4 * i + c];
    double g_weight = g[3];
    for (int c = 0; c < 3; c++) g_points[3 * k + c] = S(g[c] * weights[k]), g_weight += g[c] * points[3 * k + c];
    g_weights[k] = S(g_weight);
  }
}
// Gradients of the stroke's points and weights.
template <class S> HD void from_control(const S *points, const S *weights, int K, const double *g_control, S *g_points, S *g_weights) {
  if (K == 2) lower<2>(points, weights, g_control, g_points, g_weights);
  else if (K == 3) lower<3>(points, weights, g_control, g_points, g_weights);
  else lower<4>(points, weights, g_control, g_points, g_weights);
}
}  // namespace stroke
