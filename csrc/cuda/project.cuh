// Strokes in space to cubics of each view, and the gradients of strokes and cameras from those of each view, in double precision and a fixed
// order.
#pragma once
#include "common/project.h"
#include "cuda/job.cuh"

namespace stroke {
__device__ inline const real *points_of(const Job &J, u32 n) { return J.points + u64(n) * J.controls * 3; }
__device__ inline const real *weights_of(const Job &J, u32 n) { return J.weights + u64(n) * J.controls; }

// i: view and stroke.
__device__ inline void project_stroke(const Job &J, u32 i) {
  const u32 view = i / J.strokes, n = i % J.strokes;
  double control[16];
  control_of(points_of(J, n), weights_of(J, n), J.controls, control);
  to_view(J.matrices + 16 * view, control, J.cubics + 16 * u64(i));
}

// Sums over the views of stroke n.
__device__ inline void gather_stroke(const Job &J, u32 n) {
  double appearance[5] = {}, control[16] = {};
  for (u32 view = 0; view < u32(J.views); view++) {
    const u64 i = u64(view) * J.strokes + n;
    for (int k = 0; k < 5; k++) appearance[k] += J.g_appearance[5 * i + k];
    if (J.half_width_per_view) J.g_widths[i] = real(J.g_appearance[5 * i]);
    if (J.controls) from_view(J.matrices + 16 * view, J.g_cubics + 16 * i, control);
  }
  if (!J.half_width_per_view) J.g_widths[n] = real(appearance[0] * J.width_scale);
  J.g_opacities[n] = real(appearance[1]);
  for (int k = 0; k < 3; k++) J.g_colors[3 * u64(n) + k] = real(appearance[2 + k]);
  const u64 at = u64(n) * J.controls;
  if (J.controls) from_control(points_of(J, n), weights_of(J, n), J.controls, control, J.g_points + 3 * at, J.g_weights + at);
}

// Sums over the strokes of a view, by one block: a thread takes every so manieth stroke, then threads add up in pairs.
constexpr u32 GATHER_THREADS = 128;
__device__ inline void gather_camera(const Job &J, u32 view) {
  __shared__ double sums[GATHER_THREADS];
  double matrix[16] = {}, control[16];
  for (u32 n = threadIdx.x; n < u32(J.strokes); n += GATHER_THREADS) {
    control_of(points_of(J, n), weights_of(J, n), J.controls, control);
    to_matrix(control, J.g_cubics + 16 * (u64(view) * J.strokes + n), matrix);
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
