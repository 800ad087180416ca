// From the sums of tiles and outlines to the gradient of each stroke in each view. Included by driver.cpp only.
#pragma once
#include "common/adjoint.h"
#include "cpu/driver.h"

namespace stroke {
namespace {
// Gradient of one stroke in one view from the sums of its pieces (in order), in double precision.
template <class S> void finish_view(const State<S> &st, const Job<S> &J, const S *outline_sums, size_t i, double *g_cubic, double *appearance) {
  double stroke[16] = {};
  const uint32_t p0 = st.piece_first[i], p1 = st.piece_first[i + 1];
  for (uint32_t p = p0; p < p1; p++) {
    double m[NGRAD] = {}, control[16];
    for (uint32_t t = st.stroke_intersection_first[i]; t < st.stroke_intersection_first[i + 1]; t++) {
      const auto &intersection = st.stroke_intersections[t];
      if (p < intersection.piece || p >= intersection.piece + intersection.pieces) continue;
      const S *sums = J.g_slot + size_t(st.intersections[intersection.intersection].slot + (p - intersection.piece)) * NGRAD;
      for (int k = 0; k < NGRAD; k++) m[k] += sums[k];
    }
    for (int k = 0; outline_sums && k < NGRAD; k++) m[k] += outline_sums[size_t(p) * NGRAD + k];
    control_gradient<double>(m, st.flat.pieces[p].ox, st.flat.pieces[p].oy, control);
    const double *map = st.flat.piece_info[p].map;
    for (int a = 0; a < 4; a++)
      for (int b = 0; b < 4; b++)
        for (int k = 0; k < 4; k++) stroke[4 * b + k] += map[4 * a + b] * control[4 * a + k];
    for (int k = 0; k < 5; k++) appearance[k] += m[16 + k];
  }
  for (int k = 0; k < 16; k++) g_cubic[k] = stroke[k] * st.scale[i];
}
}  // namespace
}  // namespace stroke
