// From the sums of tiles and outlines to the gradient of each stroke in each view. Included by driver.cpp only.
#pragma once
#include "common/adjoint.h"
#include "cpu/driver.h"

namespace stroke {
namespace {
// Gradients of one stroke, summed over views: of its half width, opacity and colour, or of half widths at the control points of its segments.
struct Appearance {
  double half_width = 0, opacity = 0, color[3] = {}, square[4] = {};
  std::vector<double> widths;  // 4 a segment
};

// Adds those of the stroke of row i, whose segments are rows from `first` on, and writes the gradients of their cubics, from the sums of its pieces,
// in double precision and in their order.
template <class S>
void finish_view(const State<S> &st, const Job<S> &J, const S *outline_sums, size_t i, size_t first, int segments, double *g_cubics,
                 Appearance &view_sums) {
  const Input<S> &in = st.input;
  const size_t last = first + segments;
  const uint32_t p0 = st.piece_first[first], p1 = st.piece_first[last];
  thread_local std::vector<double> sums;
  sums.assign(size_t(p1 - p0) * NGRAD, 0.);
  for (uint32_t t = st.stroke_intersection_first[i]; t < st.stroke_intersection_first[i + 1]; t++) {
    const auto &intersection = st.stroke_intersections[t];
    const S *slots = J.g_slot + size_t(st.intersections[intersection.intersection].slot) * NGRAD;
    double *to = sums.data() + size_t(intersection.piece - p0) * NGRAD;
    for (size_t k = 0; k < size_t(intersection.pieces) * NGRAD; k++) to[k] += slots[k];
    const size_t square = size_t(st.intersections[intersection.intersection].slot) * 4;
    for (size_t k = 0; J.g_square && k < size_t(intersection.pieces) * 4; k++) view_sums.square[k % 4] += J.g_square[square + k];
  }
  for (size_t m = first; m < last; m++) {
    double segment[16] = {}, *widths = in.half_width_along ? view_sums.widths.data() + 4 * (m - first) : nullptr;
    for (uint32_t p = st.piece_first[m]; p < st.piece_first[m + 1]; p++) {
      double *s = sums.data() + size_t(p - p0) * NGRAD, control[16], of_widths[4];
      for (int k = 0; outline_sums && k < NGRAD; k++) s[k] += outline_sums[size_t(p) * NSUMS + k];
      for (int k = 0; outline_sums && k < 4; k++) view_sums.square[k] += outline_sums[size_t(p) * NSUMS + OF_SQUARE + k];
      control_gradient<double>(s, st.flat.pieces[p], control);
      const double *map = st.flat.piece_info[p].map;
      for (int a = 0; a < 4; a++)
        for (int b = 0; b < 4; b++)
          for (int k = 0; k < 4; k++) segment[4 * b + k] += map[4 * a + b] * control[4 * a + k];
      view_sums.half_width += s[OF_WIDTH], view_sums.opacity += s[OF_OPACITY];
      for (int k = 0; k < 3; k++) view_sums.color[k] += s[OF_COLOR + k];
      if (!widths) continue;
      width_gradient(s + OF_WIDTH, of_widths);
      for (int a = 0; a < 4; a++)
        for (int b = 0; b < 4; b++) widths[b] += map[4 * a + b] * of_widths[a];
    }
    for (int k = 0; k < 16; k++) g_cubics[16 * m + k] = segment[k] * st.scale[m];
  }
}
}  // namespace
}  // namespace stroke
