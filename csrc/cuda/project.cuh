// Strokes in space to cubics of each view, and the gradients of strokes and cameras from those of each view, in double precision and a fixed
// order.
#pragma once
#include "common/project.h"
#include "cuda/job.cuh"

namespace stroke {
__device__ inline const real *points_of(const Job &J, u32 m) { return J.points + u64(m) * J.controls * 3; }
__device__ inline const real *weights_of(const Job &J, u32 m) { return J.weights + u64(m) * J.controls; }

template <class S> __device__ void matrix_of_view(const Job &J, u32 view, double *out) {
  matrix_of(static_cast<const S *>(J.poses) + 16 * view, static_cast<const S *>(J.intrinsics) + 9 * view, J.orthographic, out);
}
// Made anew: those that other threads make may not be there yet.
__device__ inline void make_matrix(const Job &J, u32 view, double *out) {
  if (J.cameras_double) matrix_of_view<double>(J, view, out);
  else matrix_of_view<float>(J, view, out);
}
// i: the row of a segment.
__device__ inline void project_segment(const Job &J, u32 i) {
  const Seen seen = seen_in(layout_of(J), SEGMENTS, i);
  double control[16], matrix[16];
  if (J.poses) make_matrix(J, seen.view, matrix);
  else
    for (int k = 0; k < 16; k++) matrix[k] = J.matrices[16 * seen.view + k];
  control_of(points_of(J, seen.index), weights_of(J, seen.index), J.controls, control);
  to_view(matrix, control, J.cubics + 16 * u64(i));
}

constexpr int OF_APPEARANCE = NSUMS - 16;  // numbers of g_appearance: of the half width's polynomial, opacity, colour and T
// Sums over the views and segments of stroke n.
__device__ inline void gather_stroke(const Job &J, u32 n) {
  double sums[OF_APPEARANCE] = {};
  const u32 first = first_of(J, n), segments = first_of(J, n + 1) - first;
  const Rows stroke = rows_of(layout_of(J), STROKES, n), segment = rows_of(layout_of(J), SEGMENTS, first);
  for (int view = stroke.first_view; view < stroke.end_view; view++) {
    double one[OF_APPEARANCE] = {};
    for (u32 m = 0; m < segments; m++)
      for (int k = 0; k < OF_APPEARANCE; k++) one[k] += J.g_appearance[OF_APPEARANCE * (u64(segment.at(view)) + m) + k];
    for (int k = 0; k < OF_APPEARANCE; k++) sums[k] += one[k];
    if (J.half_width_per_view && !J.along) J.g_widths[stroke.at(view)] = real(one[0]);
  }
  if (!J.half_width_per_view && !J.along) J.g_widths[n] = real(sums[0] * J.width_scale);
  J.g_opacities[n] = real(sums[OF_OPACITY - OF_WIDTH]);
  for (int k = 0; k < 3; k++) J.g_colors[3 * u64(n) + k] = real(sums[OF_COLOR - OF_WIDTH + k]);
}
// Sums over the views of segment m.
__device__ inline void gather_segment(const Job &J, u32 m) {
  double widths[4] = {}, control[16] = {};
  const Rows rows = rows_of(layout_of(J), SEGMENTS, m);
  for (int view = rows.first_view; view < rows.end_view; view++) {
    const u64 i = rows.at(view);
    if (J.along)
      for (int k = 0; k < 4; k++) {
        widths[k] += J.g_appearance[OF_APPEARANCE * i + k];
        if (J.half_width_per_view) J.g_widths[4 * i + k] = real(J.g_appearance[OF_APPEARANCE * i + k]);
      }
    if (J.controls) from_view(J.matrices + 16 * view, J.g_cubics + 16 * i, control);
  }
  for (int k = 0; k < 4 && J.along && !J.half_width_per_view; k++) J.g_widths[4 * u64(m) + k] = real(widths[k] * J.width_scale);
  const u64 at = u64(m) * J.controls;
  if (J.controls) from_control(points_of(J, m), weights_of(J, m), J.controls, control, J.g_points + 3 * at, J.g_weights + at);
}

// The gradient of a view's Square: sums over its segments of that of T, which changes it by T times itself.
__device__ inline void gather_square(const Job &J, u32 view) {
  double sums[4] = {};
  const SegmentsSeen seen = segments_of(layout_of(J), int(view));
  for (int k = 0; k < seen.end - seen.first; k++)
    for (int i = 0; i < 4; i++) sums[i] += J.g_appearance[OF_APPEARANCE * (u64(seen.first_row) + k) + OF_SQUARE - OF_WIDTH + i];
  square_gradient(square_of(J, view), sums, J.g_squares + 4 * u64(view));
}

// Sums over the segments of a view, by one block: a thread takes every so manieth segment, then threads add up in pairs.
constexpr u32 GATHER_THREADS = 128;
__device__ inline void gather_camera(const Job &J, u32 view) {
  __shared__ double sums[GATHER_THREADS];
  double matrix[16] = {}, control[16];
  const SegmentsSeen seen = segments_of(layout_of(J), int(view));
  for (u32 k = threadIdx.x; k < u32(seen.end - seen.first); k += GATHER_THREADS) {
    const u32 m = seen.first + k;
    control_of(points_of(J, m), weights_of(J, m), J.controls, control);
    to_matrix(control, J.g_cubics + 16 * (u64(seen.first_row) + k), matrix);
  }
  for (u32 k = 0; k < 16; k++) {
    sums[threadIdx.x] = matrix[k];
    for (u32 half = GATHER_THREADS / 2; half; half /= 2) {
      __syncthreads();
      if (threadIdx.x < half) sums[threadIdx.x] += sums[threadIdx.x + half];
    }
    if (threadIdx.x == 0) J.g_matrices[16 * view + k] = sums[0];
    __syncthreads();
  }
}
}  // namespace stroke
