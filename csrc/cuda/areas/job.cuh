// The job that the CUDA kernels of areas are given: everything they read and write; area_job.py has the same fields in the same order.
#pragma once
#include "common/areas/paint.h"
#include "common/areas/sweep.h"
#include "cuda/warp.cuh"

namespace stroke::areas {
// Lists whose length only the device knows: what is counted of each, and bounded by the memory there is.
enum { VERTICES, PIECES, HEIGHTS, SHARES, BORDERS, ROW_SUMS, COUNTERS };
constexpr int CONTROL_SUMS = 12, MOVE_SUMS = 6, PART_SUMS = CONTROL_SUMS + MOVE_SUMS;

// A segment of a layer's contour: its degree and control points; the contour's first segment, and number of segments.
struct Part {
  int layer, degree, index[4], first, count, closed;
};
// What a layer covers of a row of pixels: of columns `left` up to `right` the shares from `share` on, and one more; borders; sums of its paint.
struct Run {
  int left, right;
  u32 share, border, borders, sums;
};
// Rows of the picture.
struct Span {
  int first, end;
};

struct Job {
  const real *points, *half_widths, *transforms, *axes, *offsets, *colors, *background;
  const int *layers, *paints;
  const Part *parts;
  const int *layer_parts, *layer_sums;  // per layer, and one more: its first part; its first sum, of MOVE_SUMS and those of its paint
  const int *point_first, *uses;        // per point, and one more: its part of uses, each a control point (of four) of a part
  real *image;
  u64 *counters;
  // per part, and one more
  u32 *vertex_first;
  Vertex *vertices;
  Link *links;
  Span *heads;   // per vertex: rows in which a chain begins with its edge
  Span *bounds;  // per layer
  Run *runs;     // per layer and row
  // of each piece of a row of a layer
  Piece *pieces;
  Chain *chains;
  double *keys;
  int *active, *by_left;
  double *heights;
  double *shares;
  Border *borders;
  // backward
  const real *g_image;
  real *states;       // per share: the pixel before the layer, 8 numbers; later 4, the gradient of the layer's colour there
  real *g_shares;     // per share
  double *row_sums;   // of the paint
  double *g_edges;    // per vertex: of the ends of its edge
  double *part_sums;  // per part: of control points (x, y, half width), of the transform
  double *layer_totals;
  real *g_points, *g_half_widths, *g_transforms, *g_axes, *g_offsets, *g_colors, *g_background;
  u64 limit[COUNTERS];
  int width, height, point_count, part_count, layer_count, transform_count, paint_count, stop_count, save;
};

// What area_job.py repeats to know how much memory the arrays take.
static_assert(sizeof(Part) == 36 && sizeof(Run) == 24 && sizeof(Span) == 8 && sizeof(Vertex) == 48 && sizeof(Link) == 8);
static_assert(sizeof(Piece) == 40 && sizeof(Chain) == 48 && sizeof(Border) == 40 && COUNTERS == 6 && PART_SUMS == 18);

__device__ inline Tables<real> tables_of(const Job &J) {
  return {J.points, J.half_widths, J.transforms,  J.axes,        J.offsets,         J.colors,      nullptr,     nullptr,
          J.layers, J.paints,      J.point_count, J.layer_count, J.transform_count, J.paint_count, J.stop_count};
}
__device__ inline Polygons polygons_of(const Job &J) { return {J.vertices, J.links}; }
__device__ inline Matrix matrix_of(const Job &J, int layer) { return Matrix::of(J.transforms + 6 * J.layers[5 * layer + 3]); }
__device__ inline Run &run_of(const Job &J, int layer, int row) { return J.runs[u64(layer) * J.height + row]; }
__device__ inline Segment segment_of(const Job &J, int part) {
  const Part &p = J.parts[part];
  Segment s;
  s.degree = p.degree;
  for (int i = 0; i <= p.degree; i++) {
    const int k = s.index[i] = p.index[i];
    s.p[i] = {double(J.points[2 * k]), double(J.points[2 * k + 1])}, s.w[i] = double(J.half_widths[k]);
  }
  return s;
}
__device__ inline Span rows_between(const Job &J, double first, double end) { return {int(clamp(first, 0, J.height)), int(clamp(end, 0, J.height))}; }
// Vertices of all layers; none where they found no room.
__device__ inline u32 vertex_count(const Job &J) { return J.counters[VERTICES] <= J.limit[VERTICES] ? u32(J.counters[VERTICES]) : 0; }
// A part of a list, or NONE where there is no room: then the host does it all again with more. Where it lies changes no result.
__device__ inline u32 take(const Job &J, int list, u32 n) {
  const u64 first = atomicAdd(J.counters + list, u64(n));
  return first + n <= J.limit[list] ? u32(first) : NONE;
}
}  // namespace stroke::areas
