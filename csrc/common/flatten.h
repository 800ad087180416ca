// What flattening is, for every driver: when a part of a stroke is tame, when a curve may pass for its chord, and the pieces and chords that
// come of it (docs/explanation/mathematics.md, section "Flattening"). The drivers differ in how they walk through the parts.
#pragma once
#include "common/closest.h"
#ifndef __CUDACC_RTC__
#include <cstdint>
#else
using uint32_t = unsigned;
using uint64_t = unsigned long long;
#endif

namespace stroke {
#if defined(__CUDACC__) || defined(STROKE_EMULATE)
template <class T> struct Four {
  T v[4];
  HD T &operator[](int i) { return v[i]; }
  HD T operator[](int i) const { return v[i]; }
};
#define STROKE_FOUR(op)                                                                                                                              \
  template <class T> HD Four<T> operator op(const Four<T> &a, const Four<T> &b) {                                                                    \
    return {a.v[0] op b.v[0], a.v[1] op b.v[1], a.v[2] op b.v[2], a.v[3] op b.v[3]};                                                                 \
  }                                                                                                                                                  \
  template <class T> HD Four<T> operator op(const Four<T> &a, T b) { return a op Four<T>{b, b, b, b}; }                                              \
  template <class T> HD Four<T> &operator op## = (Four<T> & a, const Four<T> &b) { return a = a op b; }
STROKE_FOUR(+)
STROKE_FOUR(-)
STROKE_FOUR(*)
STROKE_FOUR(/)
#undef STROKE_FOUR
using v4d = Four<double>;
#else
typedef double v4d __attribute__((vector_size(32)));
#endif

// Four homogeneous control points (X, Y, Z, W): the pixel is (X, Y) / Z, the depth Z / W, or W / Z in an orthographic view.
struct Control {
  v4d c[4];
};
// Of a piece. start, stop: parameters in its segment; map: from the segment's control points to those of the piece. before: the piece that it
// goes on from, over a joint of the stroke or within a segment; NO_PIECE at a cap.
constexpr uint32_t NO_PIECE = ~uint32_t(0);
struct PieceInfo {
  uint32_t stroke, segment, before;
  double start, stop;
  uint32_t first_chord, end_chord;
  bool cap_start, cap_stop;
  double map[16];
};
// Directions of the curve at the ends of a chord.
struct Tangents {
  float ax, ay, bx, by;
};

// Monte Carlo: chords turn by less than this (about radians) unless they are shorter than that (px): these stand for a jump of the tangent.
constexpr float OUTLINE_TURN = .3, OUTLINE_MIN = .002;
constexpr int MAX_DEPTH = 48;  // cuts of a span into pieces
// Cuts of a stroke: the largest image takes some hundreds. At coordinates of 1e20 rounding may leave parts that no cut tames.
constexpr int MAX_CUTS = 4096;
constexpr int MAX_CHORD_DEPTH = 15;  // halvings of a piece: below, float has no digits left
constexpr double MAX_RATIO = 16;     // of the weights Z, and W, within a piece: float32 keeps its digits
constexpr double MAX_EXTENT = 1024;  // px of a piece: float32 resolves 1e-4 px in it
constexpr float MAX_SKEW = .25;      // of a chord's length: how unevenly the parameter may run along it
constexpr float FOLD_TOL = .01;      // px along the chord; a curve that folds back within less does no harm
constexpr double MAX_COORDINATE = 1e100;

HD double low(const v4d *p, int k) { return least(p[0][k], p[1][k], p[2][k], p[3][k]); }
HD double high(const v4d *p, int k) { return most(p[0][k], p[1][k], p[2][k], p[3][k]); }

// The place in (X, Y, Z, W) of the curve's own weight, which depth is divided by.
HD int weight_place(bool orthographic) { return orthographic ? 2 : 3; }
// Positive where the depth is more than `near`.
HD double near_margin(const v4d &c, double near, bool orthographic) { return orthographic ? c[3] - near * c[2] : c[2] - near * c[3]; }

// Whether a stroke with these numbers can be drawn.
template <class S> HD bool drawable(const double *cubic, bool orthographic, double half_width, const S *color, double opacity) {
  bool good = half_width >= 0 && half_width < MAX_COORDINATE && opacity >= 0 && opacity <= 1;
  for (int k = 0; k < 3; k++) good = good && color[k] - color[k] == 0;  // finite
  for (int k = 0; k < 16; k++) good = good && abs(cubic[k]) < MAX_COORDINATE;
  for (int k = weight_place(orthographic); k < 16; k += 4) good = good && cubic[k] > 0;
  return good;
}

// The half width polynomial of a piece from those at the segment's control points.
template <class S> HD void place_widths(const double *widths, const double *map, S *out) {
  double control[4] = {};
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++) control[i] += map[4 * i + j] * widths[j];
  for (int k = 0; k < 4; k++) out[k] = S(bern(0, k) * control[0] + bern(1, k) * control[1] + bern(2, k) * control[2] + bern(3, k) * control[3]);
}

// px beyond which a segment covers nothing; farther than the image is wide nothing changes. half_width: the largest. stretch: of Square.
HD double reach_of(const double *cubic, double half_width, bool world, double near, double filter_reach, int width, int height, double stretch) {
  double wide = half_width;
  if (world) {
    double depth = 1e300;  // of the control points, whose hull holds all depths
    for (int i = 0; i < 4; i++) depth = least(depth, cubic[4 * i + 2] / cubic[4 * i + 3]);
    wide = half_width / most(depth, near);
  }
  return least(wide, 4. * (width + height) * stretch) + filter_reach * stretch + CHORD_TOL;
}

HD bool positive(const Control &k) { return k.c[0][2] > 0 && k.c[1][2] > 0 && k.c[2][2] > 0 && k.c[3][2] > 0; }
HD v4d on_screen(v4d c) { return c / c[2]; }
HD bool tame(const Control &k, const v4d *p) {
  return high(k.c, 2) <= MAX_RATIO * low(k.c, 2) && high(k.c, 3) <= MAX_RATIO * low(k.c, 3) && high(p, 0) - low(p, 0) <= MAX_EXTENT &&
         high(p, 1) - low(p, 1) <= MAX_EXTENT;
}

// The matrix from the stroke's control points to those of its part from a to b: row i is the blossom at (a, .., b, .. i times).
template <class T> HD void blossom(T a, T b, T *map) {
  for (int i = 0; i < 4; i++) {
    T row[5] = {1, 0, 0, 0, 0};
    for (int k = 0; k < 3; k++) {
      const T t = k < i ? b : a;
      for (int j = k + 1; j >= 0; j--) row[j] = row[j] * (1 - t) + (j ? row[j - 1] * t : 0);
    }
    for (int j = 0; j < 4; j++) map[4 * i + j] = row[j];
  }
}
HD Control mapped(const Control &k, const double *map) {
  Control out = {};
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++) out.c[i] += k.c[j] * map[4 * i + j];
  return out;
}

// The homogeneous control points of a part of a piece relative to its origin (float is exact to 1e-4 px), and the same on screen. F is float,
// or a vector of as many parts as it has lanes.
template <class F> struct Arc {
  F x[4], y[4], z[4], u[4], v[4];
};
template <class F> HD void project(Arc<F> &k) {
  for (int i = 0; i < 4; i++) k.u[i] = k.x[i] / k.z[i], k.v[i] = k.y[i] / k.z[i];
}
// Square roots of a number or of lanes, and whether something holds for any lane. Names of their own: the kernels' sqrt and any are for their vectors.
template <class F> HD F sqrt_each(F x) {
  if constexpr (sizeof(F) == sizeof(float)) return sqrt(x);
  else
    for (unsigned i = 0; i < sizeof(F) / sizeof(float); i++) x[i] = sqrt(x[i]);
  return x;
}
template <class Mask> HD bool any_lane(const Mask &m) {
  if constexpr (sizeof(Mask) <= sizeof(int)) return m;
  else {
    int found = 0;
    for (unsigned i = 0; i < sizeof(Mask) / sizeof(int); i++) found |= m[i];
    return found;
  }
}

// A control point relative to the origin of a piece, where distances are measured.
template <class S> HD v4d relative(const v4d &k, double ox, double oy, const Piece<S> &c) {
  v4d out = k - v4d{ox, oy, 0, 0} * k[2];
  if (c.oblong) {
    double x = out[0], y = out[1];
    square_of(c).map(x, y);
    out[0] = x, out[1] = y;
  }
  return out;
}
// A piece without its appearance, and its arc, from control points k with the points p on screen.
template <class S> HD Arc<float> make_piece(const Control &k, const v4d *p, Piece<S> &c) {
  const double ox = round((p[0][0] + p[3][0]) / 2), oy = round((p[0][1] + p[3][1]) / 2);
  for (int i = 0; i < 4; i++) {
    v4d s = {};
    for (int j = 0; j < 4; j++) s += relative(k.c[j], ox, oy, c) * bern(j, i);
    c.x[i] = S(s[0]), c.y[i] = S(s[1]), c.z[i] = S(s[2]), c.w[i] = S(s[3]);
  }
  const bool flat_w = !c.orthographic && k.c[0][3] == k.c[1][3] && k.c[0][3] == k.c[2][3] && k.c[0][3] == k.c[3][3];
  c.flat_w = flat_w ? S(1 / k.c[0][3]) : S(0);
  c.ox = S(ox), c.oy = S(oy);
  Arc<float> arc;
  for (int i = 0; i < 4; i++) {
    const v4d local = relative(k.c[i], ox, oy, c);
    arc.x[i] = float(local[0]), arc.y[i] = float(local[1]), arc.z[i] = float(local[2]);
  }
  project(arc);
  return arc;
}

// Directions of the curve at both ends of an arc, the angle between them (about), and the length of the chord.
template <class F> struct Direction {
  F x, y;
};
template <class F> HD F turning(Direction<F> a, Direction<F> b) { return sqrt_each((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y)); }
// The direction to the first of two points that is not here, else none.
template <class F> HD Direction<F> leaving(F x1, F y1, F x2, F y2, F small) {
  const F l1 = sqrt_each(x1 * x1 + y1 * y1), l2 = sqrt_each(x2 * x2 + y2 * y2);
  const auto first = l1 > small, second = l2 > small;
  const F none = small * 0.f, x = second ? x2 / l2 : none, y = second ? y2 / l2 : none;
  return {first ? x1 / l1 : x, first ? y1 / l1 : y};
}
template <class F> struct Ends {
  Direction<F> a, b;
  F turn, length;
};
template <class F> HD Ends<F> ends_of(const Arc<F> &k) {
  const F ax = k.u[1] - k.u[0], ay = k.v[1] - k.v[0], bx = k.u[3] - k.u[2], by = k.v[3] - k.v[2], ex = k.u[3] - k.u[0], ey = k.v[3] - k.v[0];
  const F la = sqrt_each(ax * ax + ay * ay), lb = sqrt_each(bx * bx + by * by), l = sqrt_each(ex * ex + ey * ey), small = 1e-6f * (1.f + l);
  Ends<F> out = {{ax / la, ay / la}, {bx / lb, by / lb}, l, l};
  // Where a neighbour coincides with an end, the next point says where the curve goes.
  const auto at_a = la <= small, at_b = lb <= small;
  if (any_lane(at_a)) {
    const Direction<F> d = leaving(k.u[2] - k.u[0], k.v[2] - k.v[0], ex, ey, small);
    out.a = {at_a ? d.x : out.a.x, at_a ? d.y : out.a.y};
  }
  if (any_lane(at_b)) {
    const Direction<F> d = leaving(k.u[3] - k.u[1], k.v[3] - k.v[1], ex, ey, small);
    out.b = {at_b ? d.x : out.b.x, at_b ? d.y : out.b.y};
  }
  out.turn = turning(out.a, out.b);
  return out;
}

// The chord of an arc that begins at t0 and is dt long in the piece's parameter from 0 to 1; relative to the piece's origin.
template <class F> HD Chord<F> make_chord(const Arc<F> &k, F t0, float dt) {
  const F ex = k.u[3] - k.u[0], ey = k.v[3] - k.v[0], ee = ex * ex + ey * ey, none = ee * 0.f, il = ee > 1e-24f ? 1.f / ee : none;
  // Fraction of the chord reached in the middle of the parameter; the bow brings that point to one half.
  const F z = 1.f / (k.z[0] + 3.f * (k.z[1] + k.z[2]) + k.z[3]);
  const F mx = (k.x[0] + 3.f * (k.x[1] + k.x[2]) + k.x[3]) * z - k.u[0], my = (k.y[0] + 3.f * (k.y[1] + k.y[2]) + k.y[3]) * z - k.v[0];
  const F m = least(most((mx * ex + my * ey) * il, none + .3f), none + .7f), bow = dt * (.5f - m) / (m * (1.f - m));
  return {k.u[0], k.v[0], ex, ey, ex * il, ey * il, t0 - .5f, none + dt, bow};
}
template <class S> HD Chord<S> placed(Chord<float> c, const Piece<S> &piece) {
  if (piece.oblong) {
    const Square<S> back = square_of(piece).inverse();
    back.map(c.ax, c.ay), back.map(c.ex, c.ey), square_of(piece).transpose().map(c.ix, c.iy);
  }
  return {S(c.ax) + piece.ox, S(c.ay) + piece.oy, S(c.ex), S(c.ey), S(c.ix), S(c.iy), S(c.tau0), S(c.dtau), S(c.bow)};
}

// Whether the curve is too far from its chord to pass for it, but for its turning. Squares throughout: no roots, no divisions.
template <class F> HD auto crooked(const Arc<F> &k, F &most_across) {
  const F ex = k.u[3] - k.u[0], ey = k.v[3] - k.v[0], ee = ex * ex + ey * ey;
  // Of the inner control points from even places on the chord: across and along it, both times its length.
  const F ax = k.u[1] - k.u[0] - ex * (1 / 3.f), ay = k.v[1] - k.v[0] - ey * (1 / 3.f);
  const F bx = k.u[2] - k.u[0] - ex * (2 / 3.f), by = k.v[2] - k.v[0] - ey * (2 / 3.f);
  const F across_a = ax * ey - ay * ex, across_b = bx * ey - by * ex, along_a = ax * ex + ay * ey, along_b = bx * ex + by * ey;
  // A control point at distance d pulls the curve .75 d away at most.
  constexpr float TOL2 = CHORD_TOL * CHORD_TOL / .5625, FOLD2 = FOLD_TOL * FOLD_TOL, SKEW2 = MAX_SKEW * MAX_SKEW;
  most_across = most(across_a * across_a, across_b * across_b);
  const auto uneven = most(along_a * along_a, along_b * along_b) > most(FOLD2 * ee, SKEW2 * ee * ee);
  const auto loop = (ee < 1e-12f) & (most(ax * ax + ay * ay, bx * bx + by * by) > FOLD2);
  // Newton starts where the parameter runs evenly along the chord.
  const auto deep = most(k.z[0], k.z[1], k.z[2], k.z[3]) > 1.5f * least(k.z[0], k.z[1], k.z[2], k.z[3]);
  return (most_across > TOL2 * ee) | uneven | loop | deep;
}
// Whether it turns too much for that, for a stroke of this reach; outline: more than the Monte Carlo boundary samples can do with.
template <class F> HD auto sharp(const Ends<F> &e, F most_across, double reach, bool outline) {
  constexpr float TIGHT2 = TIGHT_CHORD_TOL * TIGHT_CHORD_TOL / .5625;
  const F ee = e.length * e.length;
  const float turn = outline ? OUTLINE_TURN : 1e30f;
  return ((most_across > TIGHT2 * ee) & (e.turn * e.turn * float(reach * reach) > float(TIGHT * TIGHT) * ee)) |
         ((e.turn > turn) & (e.length > OUTLINE_MIN));
}

// A piece is halved so often without a question: half as finely as the largest second difference asks for.
HD int sure_depth(const Arc<float> &k) {
  const float ax = k.u[0] - 2 * k.u[1] + k.u[2], ay = k.v[0] - 2 * k.v[1] + k.v[2], bx = k.u[1] - 2 * k.u[2] + k.u[3],
              by = k.v[1] - 2 * k.v[2] + k.v[3];
  // n^2 for chords of even length in the parameter: |p''| / (8 tol), |p''| <= 6 times the second difference.
  const float n2 = .75f / float(CHORD_TOL) * sqrt(most(ax * ax + ay * ay, bx * bx + by * by));
  int depth = 0;
  while (depth < MAX_CHORD_DEPTH && n2 > 16.f * float(1 << (2 * depth))) depth++;
  return depth;
}

// The image, widened by a stroke's reach.
struct Frame {
  double left, right, top, bottom;
  // The control points' hull, which holds the curve, misses the image by more than the stroke's reach. NaN counts as a miss.
  HD bool outside(const v4d *p) const { return !(high(p, 0) >= left && low(p, 0) <= right && high(p, 1) >= top && low(p, 1) <= bottom); }
  HD bool inside(const v4d *p) const { return low(p, 0) >= left && high(p, 0) <= right && low(p, 1) >= top && high(p, 1) <= bottom; }
  template <class S> HD bool outside(const Arc<float> &k, const Piece<S> &c) const {
    if (c.oblong) return false;  // arcs are not in pixels there; its chords are dropped with the tiles that they miss
    const float x0 = least(k.u[0], k.u[1], k.u[2], k.u[3]), x1 = most(k.u[0], k.u[1], k.u[2], k.u[3]);
    const float y0 = least(k.v[0], k.v[1], k.v[2], k.v[3]), y1 = most(k.v[0], k.v[1], k.v[2], k.v[3]);
    return !(x1 + c.ox >= left && x0 + c.ox <= right && y1 + c.oy >= top && y0 + c.oy <= bottom);
  }
};

// The parameter at which a part is cut: the middle of the parameter that makes both end weights equal.
HD double cut_at(const Control &k) {
  const double c = cbrt(k.c[0][2] / k.c[3][2]);
  return clamp(c / (1 + c), 1e-6, 1 - 1e-6);
}
}  // namespace stroke
