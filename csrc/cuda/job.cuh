// The job that all CUDA kernels are given to rasterize rational strokes: everything they read and write. No host headers, so that NVRTC
// compiles this as it is. REAL: the precision of pixels.
#pragma once
#include "common/adjoint.h"
#include "common/flatten.h"
#include "common/layout.h"
#ifndef REAL
#define REAL float
#endif

namespace stroke {
using u32 = unsigned;
using u64 = unsigned long long;
using real = REAL;
constexpr u32 NONE = ~0u, ALL = ~0u;  // no index; all lanes
constexpr int PIX = TILE * TILE, WARP = 32, WARPS = PIX / WARP;
template <class S> struct OutlinePoint;

// Of a chord: its piece, length in px, turning of the tangent in radians.
struct ChordInfo {
  u32 piece;
  float length, turn;
};
// Where one piece meets one tile: the chords of tile_list from `first` to the next one's. smooth: they have one nearest point.
struct TilePiece {
  u32 piece, stroke, first, smooth;
};
// One stroke over one point: parameter and alpha there, depth, piece.
struct alignas(4 * sizeof(real)) Cover {
  real tau, a, z;
  u32 piece;
};
// The fragments of one piece over one tile in the 32 points of one warp: from `first` on, one for every bit of mask.
struct WarpFragments {
  u32 first, mask;
};

// What is counted on the device, and bounded by the memory there is.
enum { PIECES, CHORDS, INTERSECTIONS, TILE_PIECES, FRAGMENTS, OUTLINE, OUTLINE_FRAGMENTS, BOUNDED, ORDER = BOUNDED, OUTLINE_ORDER, BAD, COUNTERS };

// Everything a kernel reads and writes; job.py reads here what its fields are. Arrays of bounded length are as long as limit[..] says.
// An intersection is a chord and a tile that it may reach.
struct Job {
  // strokes in space and the cameras' matrices, as in project.h; null where cubics are given
  const real *points, *weights;
  double *matrices;
  // the cameras of which the drawing makes the matrices, of float or double; null where those are given
  const void *poses, *intrinsics;
  // strokes and images, as the CPU kernels' (kernel.h); half widths are half_width times width_scale
  double *cubics;
  const real *half_width, *color, *opacity, *background;
  // which segments make which stroke: the first of each stroke, and their number; the stroke of each; whether a stroke is closed. Null where
  // every segment is a stroke
  const long long *stroke_first, *segment_stroke;
  const bool *closed;
  const int *batch;      // as of Layout
  const double *square;  // (views, 2, 2): Square of each view, or null
  real *out_color, *out_alpha, *out_depth;
  real *reach;  // per row of strokes
  // per row of segments
  double *scale;
  u32 *piece_first;
  // per piece, and one more
  Piece<real> *pieces;
  PieceInfo *piece_info;
  Arc<float> *arcs;
  u32 *chord_first, *outline_first;
  // per chord, and one more
  Chord<real> *chords;
  ChordInfo *chord_info;
  Tangents *tangents;
  u32 *intersection_first;
  // per intersection: its chord; the tile piece that it is the first of, or NONE
  u32 *intersection_chord, *intersection_tile_piece;
  // per tile, and one more: its part of tile_list, the pieces over it; cursors for filling
  u32 *tile_first, *tile_cursor, *tile_piece_first, *tile_piece_count;
  u32 *tile_list;  // intersections, later chords, of each tile in order
  TilePiece *tile_pieces;
  WarpFragments *warp_fragments;  // per stratum, tile piece and warp
  Cover *fragments;
  u32 *order;                      // fragments of each point near to far
  u32 *point_first, *point_count;  // per stratum, tile and thread: its part of order
  u64 *counters;
  u64 *report;  // memory of the host
  // backward
  const real *g_color, *g_alpha, *g_depth;
  real *front, *g_fragment;  // per fragment: transmittance in front of it, dL/d(alpha)
  real *g_tile_piece;        // per tile piece: NGRAD sums
  real *g_square;            // and those of T, where they are wanted
  real *g_background;
  double *g_cubics, *g_appearance;                                 // per view and segment: 16 and NSUMS - 16 numbers
  real *g_widths, *g_colors, *g_opacities, *g_points, *g_weights;  // of the inputs
  double *g_matrices, *g_squares;
  // outlines (Monte Carlo)
  OutlinePoint<real> *outline;
  u32 *outline_list, *outline_tile_first, *outline_tile_cursor;
  real *g_outline, *outline_sums;
  WarpFragments *outline_warp_fragments;
  Cover *outline_fragments;
  u32 *outline_order;
  // numbers
  u64 limit[BOUNDED];
  u64 seed;
  long long background_view, background_row, background_pixel;
  double near, inv_sigma, filter_reach, width_scale;
  int views, strokes, segments, height, width, tiles_x, tiles_y, world, along, orthographic, strata, half_width_per_view, save;
  int sketches;  // of a batch
  int controls;  // control points of a segment in space; 0 where cubics are given
  int cameras_double, differ_squares;
};

// What job.py reads here to know how much memory the arrays take.
static_assert(TILE == 16 && WARPS == 8 && NGRAD == 24 && NSUMS == 28 && COUNTERS == 10);
static_assert(sizeof(Piece<real>) == 33 * sizeof(real) && sizeof(PieceInfo) == 176 && sizeof(Arc<float>) == 80);
static_assert(sizeof(Chord<real>) == 9 * sizeof(real) && sizeof(ChordInfo) == 12 && sizeof(Tangents) == 16);
static_assert(sizeof(TilePiece) == 16 && sizeof(WarpFragments) == 8 && sizeof(Cover) == 4 * sizeof(real));

__device__ inline Layout layout_of(const Job &J) { return {J.views, J.strokes, J.segments, J.sketches, J.batch}; }
// Rows of segments, and of strokes.
__device__ inline u32 segment_count(const Job &J) { return u32(layout_of(J).rows(SEGMENTS)); }
__device__ inline u32 stroke_count(const Job &J) { return u32(layout_of(J).rows(STROKES)); }
// The stroke of segment m, and the first segment of stroke n.
__device__ inline u32 stroke_of(const Job &J, u32 m) { return J.segment_stroke ? u32(J.segment_stroke[m]) : m; }
__device__ inline u32 first_of(const Job &J, u32 n) { return J.stroke_first ? u32(J.stroke_first[n]) : n; }
__device__ inline u32 tile_count(const Job &J) { return u32(J.views) * u32(J.tiles_x) * u32(J.tiles_y); }
__device__ inline int samples(const Job &J) { return J.strata ? J.strata * J.strata : 1; }
__device__ inline Filter<real> filter_of(const Job &J) { return {real(J.inv_sigma), real(J.filter_reach)}; }

__device__ inline const double *square_of(const Job &J, u32 view) { return J.square ? J.square + 4 * u64(view) : nullptr; }

// Whether all that was counted up to `last` found room. If not, nothing is drawn, and the host does it again with more.
__device__ inline bool fits(const Job &J, int last) {
  for (int k = 0; k <= last; k++)
    if (J.counters[k] > J.limit[k]) return false;
  return true;
}
// Length of a list, 0 where it, or one before it, did not fit.
__device__ inline u32 length_of(const Job &J, int list) { return fits(J, list) ? u32(J.counters[list]) : 0; }
}  // namespace stroke
