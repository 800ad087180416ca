// Strokes to pieces and chords, in double precision (docs/mathematics.md, section "Flattening").
#pragma once
#include "memory.h"
#include "stroke_math.h"
#include <algorithm>
#include <cmath>

namespace stroke {

// What a stroke leaves. start, stop: parameters in the stroke; map: from its control points to those of the piece.
struct PieceInfo { uint32_t stroke; double start, stop; uint32_t first_chord, end_chord; bool cap_start, cap_stop; double map[16]; };
// Directions of the curve at the ends of a chord.
struct Tangents { float ax, ay, bx, by; };
template <class S> struct Flat {
  List<Piece<S>> pieces;
  List<PieceInfo> piece_info;
  List<Chord<S>> chords;
  List<ChordInfo> chord_info;
  List<Tangents> tangents;             // of every chord; Monte Carlo only
};

// Monte Carlo: chords turn by less than this (about radians) unless they are shorter than that (px): these stand for a jump of the tangent.
constexpr float OUTLINE_TURN = .3, OUTLINE_MIN = .002;

typedef double v4d __attribute__((vector_size(32)));
typedef float v4f __attribute__((vector_size(16)));
struct Control { v4d c[4]; };  // homogeneous control points (X, Y, Z, W)

class Flattener {
  static constexpr int MAX_DEPTH = 48;         // cuts of a span into pieces
  // Cuts of a stroke: the largest image takes some hundreds. At coordinates of 1e20 rounding may leave parts that no cut tames.
  static constexpr int MAX_CUTS = 4096;
  static constexpr int MAX_CHORD_DEPTH = 15;   // halvings of a piece: below, float has no digits left
  static constexpr double MAX_RATIO = 16;      // of the weights Z, and W, within a piece: float32 keeps its digits
  static constexpr double MAX_EXTENT = 1024;   // px of a piece: float32 resolves 1e-4 px in it
  static constexpr float MAX_SKEW = .25;      // of a chord's length: how unevenly the parameter may run along it
  static constexpr float FOLD_TOL = .01;      // px along the chord; a curve that folds back within less does no harm

  struct Direction { float x, y; };
  Control whole_;
  double reach_, left_, right_, top_, bottom_;
  bool outline_;
  double span_start_ = 0, span_stop_ = 1;
  uint32_t stroke_ = 0;
  float bend_ = 0;
  Direction last_tangent_ = {};
  bool gap_ = true, partly_outside_ = true;
  int sure_depth_ = 0, cuts_ = 0;

  static void split(const Control &k, double t, Control &a, Control &b) {
    auto lerp = [t](v4d p, v4d q) { return p + (q - p) * t; };
    const v4d p01 = lerp(k.c[0], k.c[1]), p12 = lerp(k.c[1], k.c[2]), p23 = lerp(k.c[2], k.c[3]);
    const v4d p012 = lerp(p01, p12), p123 = lerp(p12, p23), middle = lerp(p012, p123);
    a = {k.c[0], p01, p012, middle}, b = {middle, p123, p23, k.c[3]};
  }
  static bool positive(const Control &k) { return k.c[0][2] > 0 && k.c[1][2] > 0 && k.c[2][2] > 0 && k.c[3][2] > 0; }
  static v4d on_screen(v4d c) { return c / c[2]; }
  template <class T> static T length(T x, T y) { return std::sqrt(x * x + y * y); }
  template <class T> static T least(T a, T b, T c, T d) { return std::min(std::min(a, b), std::min(c, d)); }
  template <class T> static T most(T a, T b, T c, T d) { return std::max(std::max(a, b), std::max(c, d)); }
  static double low(const v4d *p, int k) { return least(p[0][k], p[1][k], p[2][k], p[3][k]); }
  static double high(const v4d *p, int k) { return most(p[0][k], p[1][k], p[2][k], p[3][k]); }

  // The control points' hull, which holds the curve, misses the image by more than the stroke's reach. NaN counts as a miss.
  bool outside(const v4d *p) const {
    return !(high(p, 0) >= left_ && low(p, 0) <= right_ && high(p, 1) >= top_ && low(p, 1) <= bottom_);
  }
  bool inside(const v4d *p) const { return low(p, 0) >= left_ && high(p, 0) <= right_ && low(p, 1) >= top_ && high(p, 1) <= bottom_; }
  static bool tame(const Control &k, const v4d *p) {
    return high(k.c, 2) <= MAX_RATIO * low(k.c, 2) && high(k.c, 3) <= MAX_RATIO * low(k.c, 3) && high(p, 0) - low(p, 0) <= MAX_EXTENT &&
           high(p, 1) - low(p, 1) <= MAX_EXTENT;
  }

  // Lanes of x, y, z: the homogeneous control points of a part of a piece relative to its origin (float is exact to 1e-4 px); of u, v: the same
  // on screen.
  struct Arc { v4f x, y, z, u, v; };
  static void project(Arc &k) { k.u = k.x / k.z, k.v = k.y / k.z; }
  static void halve(v4f a, v4f &left, v4f &right) {
    const v4f p = (a + v4f{a[1], a[2], a[3], a[3]}) * .5f, q = (p + v4f{p[1], p[2], p[3], p[3]}) * .5f, r = (q + v4f{q[1], q[1], q[1], q[1]}) * .5f;
    left = v4f{a[0], p[0], q[0], r[0]}, right = v4f{r[0], q[1], p[2], a[3]};
  }
  static float turning(Direction a, Direction b) { return length(a.x - b.x, a.y - b.y); }
  // Directions of the curve at both ends of an arc, the angle between them (about), and the length of the chord.
  struct Ends { Direction a, b; float turn, length; };
  static Ends ends(const Arc &k) {
    const v4f d = {k.u[1] - k.u[0], k.v[1] - k.v[0], k.u[3] - k.u[2], k.v[3] - k.v[2]};
    const float ex = k.u[3] - k.u[0], ey = k.v[3] - k.v[0];
    v4f l = {d[0] * d[0] + d[1] * d[1], d[2] * d[2] + d[3] * d[3], ex * ex + ey * ey, 1};
    for (int i = 0; i < 4; i++) l[i] = std::sqrt(l[i]);
    const float small = 1e-6f * (1 + l[2]);
    const v4f e = d / v4f{l[0], l[0], l[1], l[1]};
    Ends out = {{e[0], e[1]}, {e[2], e[3]}, 0, l[2]};
    if (!(l[0] > small)) out.a = leaving(k, 0, 1, small);
    if (!(l[1] > small)) out.b = leaving(k, 3, -1, small);
    out.turn = turning(out.a, out.b);
    return out;
  }
  // The direction in which the points leave lane `from` where its neighbour coincides with it.
  static Direction leaving(const Arc &k, int from, int step, float small) {
    for (int i = 2; i <= 3; i++) {
      const float dx = (k.u[from + i * step] - k.u[from]) * step, dy = (k.v[from + i * step] - k.v[from]) * step, l = length(dx, dy);
      if (l > small) return {dx / l, dy / l};
    }
    return {0, 0};
  }

  template <class S> void add_chord(Flat<S> &out, const Arc &k, const Ends &e, float t0, float dt) {
    const uint32_t piece = uint32_t(out.pieces.size() - 1);
    const Piece<S> &c = out.pieces[piece];
    const float ex = k.u[3] - k.u[0], ey = k.v[3] - k.v[0], ee = ex * ex + ey * ey, il = ee > 1e-24f ? 1 / ee : 0;
    bend_ += gap_ ? SHARP : turning(last_tangent_, e.a);
    const float before = bend_;
    bend_ += e.turn * reach_ > TIGHT * e.length ? SHARP : e.turn;
    // Share of the chord reached in the middle of the parameter; the bow brings that point to one half.
    const float z = 1 / (k.z[0] + 3 * (k.z[1] + k.z[2]) + k.z[3]);
    const float mx = (k.x[0] + 3 * (k.x[1] + k.x[2]) + k.x[3]) * z - k.u[0], my = (k.y[0] + 3 * (k.y[1] + k.y[2]) + k.y[3]) * z - k.v[0];
    const float m = std::clamp((mx * ex + my * ey) * il, .3f, .7f), bow = dt * (.5f - m) / (m * (1 - m));
    out.chords.add({S(k.u[0] + c.ox), S(k.v[0] + c.oy), S(ex), S(ey), S(ex * il), S(ey * il), S(t0 - .5f), S(dt), S(bow)});
    out.chord_info.add({piece, before, bend_, e.length, e.turn});
    if (outline_) out.tangents.add({e.a.x, e.a.y, e.b.x, e.b.y});
    last_tangent_ = e.b, gap_ = false;
  }

  // Whether the curve may pass for its chord, but for its turning. Squares throughout: no roots, no divisions.
  bool flat(const Arc &k, float &most_across) const {
    const float ex = k.u[3] - k.u[0], ey = k.v[3] - k.v[0], ee = ex * ex + ey * ey;
    // Of the inner control points from even places on the chord: across and along it, both times its length.
    const v4f even = {0, 1 / 3.f, 2 / 3.f, 1}, du = k.u - k.u[0] - even * ex, dv = k.v - k.v[0] - even * ey;
    v4f across = du * ey - dv * ex, along = du * ex + dv * ey;
    across *= across, along *= along;
    // A control point at distance d pulls the curve .75 d away at most.
    constexpr float TOL2 = CHORD_TOL * CHORD_TOL / .5625;
    most_across = std::max(across[1], across[2]);
    if (most_across > TOL2 * ee || std::max(along[1], along[2]) > std::max(FOLD_TOL * FOLD_TOL * ee, MAX_SKEW * MAX_SKEW * ee * ee)) return false;
    if (ee < 1e-12f && std::max(du[1] * du[1] + dv[1] * dv[1], du[2] * du[2] + dv[2] * dv[2]) > FOLD_TOL * FOLD_TOL) return false;
    // Newton starts where the parameter runs evenly along the chord.
    return most(k.z[0], k.z[1], k.z[2], k.z[3]) <= 1.5f * least(k.z[0], k.z[1], k.z[2], k.z[3]);
  }
  // Whether it turns little enough for that.
  bool gentle(const Ends &e, float most_across) const {
    constexpr float TIGHT2 = TIGHT_CHORD_TOL * TIGHT_CHORD_TOL / .5625;
    const float ee = e.length * e.length;
    if (most_across > TIGHT2 * ee && e.turn * e.turn * float(reach_ * reach_) > float(TIGHT * TIGHT) * ee) return false;
    return !(outline_ && e.turn > OUTLINE_TURN && e.length > OUTLINE_MIN);
  }

  // A piece is halved so often without a question: half as finely as the largest second difference asks for.
  static int sure_depth(const Arc &k) {
    const float ax = k.u[0] - 2 * k.u[1] + k.u[2], ay = k.v[0] - 2 * k.v[1] + k.v[2], bx = k.u[1] - 2 * k.u[2] + k.u[3], by = k.v[1] - 2 * k.v[2] + k.v[3];
    // n^2 for chords of even length in the parameter: |p''| / (8 tol), |p''| <= 6 times the second difference.
    const float n2 = .75f / float(CHORD_TOL) * std::sqrt(std::max(ax * ax + ay * ay, bx * bx + by * by));
    int depth = 0;
    while (depth < MAX_CHORD_DEPTH && n2 > 16.f * float(1 << (2 * depth))) depth++;
    return depth;
  }

  template <class S> bool outside(const Arc &k, const Piece<S> &c) const {
    const float x0 = least(k.u[0], k.u[1], k.u[2], k.u[3]), x1 = most(k.u[0], k.u[1], k.u[2], k.u[3]);
    const float y0 = least(k.v[0], k.v[1], k.v[2], k.v[3]), y1 = most(k.v[0], k.v[1], k.v[2], k.v[3]);
    return !(x1 + c.ox >= left_ && x0 + c.ox <= right_ && y1 + c.oy >= top_ && y0 + c.oy <= bottom_);
  }

  template <class S> void chords(Flat<S> &out, const Arc &k, float t0, float dt, int depth) {
    if (partly_outside_ && outside(k, out.pieces[out.pieces.size() - 1])) {
      gap_ = true;
      return;
    }
    float across;
    if (depth >= sure_depth_ && (flat(k, across) || depth == MAX_CHORD_DEPTH)) {
      const Ends e = ends(k);
      if (gentle(e, across) || depth == MAX_CHORD_DEPTH) return add_chord(out, k, e, t0, dt);
    }
    Arc a, b;
    halve(k.x, a.x, b.x), halve(k.y, a.y, b.y), halve(k.z, a.z, b.z);
    project(a), project(b);
    chords(out, a, t0, dt / 2, depth + 1), chords(out, b, t0 + dt / 2, dt / 2, depth + 1);
  }

  template <class S> void add_piece(Flat<S> &out, const Control &k, const v4d *p, double start, double stop, const Piece<S> &look) {
    Piece<S> c = look;
    const double ox = std::round((p[0][0] + p[3][0]) / 2), oy = std::round((p[0][1] + p[3][1]) / 2);
    for (int i = 0; i < 4; i++) {
      v4d s = {};
      for (int j = 0; j < 4; j++) s += bern(j, i) * (k.c[j] - v4d{ox, oy, 0, 0} * k.c[j][2]);
      c.x[i] = S(s[0]), c.y[i] = S(s[1]), c.z[i] = S(s[2]), c.w[i] = S(s[3]);
    }
    const bool flat_w = k.c[0][3] == k.c[1][3] && k.c[0][3] == k.c[2][3] && k.c[0][3] == k.c[3][3];
    c.flat_w = flat_w ? S(1 / k.c[0][3]) : S(0);
    c.ox = S(ox), c.oy = S(oy);
    PieceInfo info{};
    info.stroke = stroke_, info.start = start, info.stop = stop;
    info.first_chord = uint32_t(out.chords.size());
    info.cap_start = start == span_start_, info.cap_stop = stop == span_stop_;
    blossom(start, stop, info.map);
    out.pieces.add(c);
    out.piece_info.add(info);
    bend_ += SHARP;
    partly_outside_ = !inside(p);
    Arc arc;
    for (int i = 0; i < 4; i++) {
      const v4d local = k.c[i] - v4d{ox, oy, 0, 0} * k.c[i][2];
      arc.x[i] = float(local[0]), arc.y[i] = float(local[1]), arc.z[i] = float(local[2]);
    }
    project(arc);
    sure_depth_ = sure_depth(arc);
    chords(out, arc, 0, 1, 0);
    if (out.chords.size() == info.first_chord) {
      out.pieces.shorten(out.pieces.size() - 1), out.piece_info.shorten(out.piece_info.size() - 1);
      return;
    }
    out.piece_info[out.piece_info.size() - 1].end_chord = uint32_t(out.chords.size());
  }

  // Cuts a visible span until its parts are tame, dropping those off the image.
  template <class S> void pieces(Flat<S> &out, const Control &k, double start, double stop, int depth, const Piece<S> &look) {
    if (positive(k)) {
      v4d p[4];
      for (int i = 0; i < 4; i++) p[i] = on_screen(k.c[i]);
      if (outside(p)) {
        gap_ = true;
        return;
      }
      if (depth == MAX_DEPTH || tame(k, p)) return add_piece(out, k, p, start, stop, look);
    } else if (depth == MAX_DEPTH || high(k.c, 2) <= 0) {
      gap_ = true;  // behind the camera: only rounding can bring such a part of a visible span about
      return;
    }
    if (++cuts_ > MAX_CUTS) {
      gap_ = true;
      return;
    }
    // In the middle of the parameter that makes both end weights equal.
    const double c = std::cbrt(k.c[0][2] / k.c[3][2]), t = std::clamp(c / (1 + c), 1e-6, 1 - 1e-6), middle = start + (stop - start) * t;
    Control a, b;
    split(k, t, a, b);
    pieces(out, a, start, middle, depth + 1, look), pieces(out, b, middle, stop, depth + 1, look);
  }

  // The matrix from the stroke's control points to those of its part from a to b: row i is the blossom at (a, .., b, .. i times).
  static void blossom(double a, double b, double *map) {
    for (int i = 0; i < 4; i++) {
      double row[5] = {1, 0, 0, 0, 0};
      for (int k = 0; k < 3; k++) {
        const double t = k < i ? b : a;
        for (int j = k + 1; j >= 0; j--) row[j] = row[j] * (1 - t) + (j ? row[j - 1] * t : 0);
      }
      for (int j = 0; j < 4; j++) map[4 * i + j] = row[j];
    }
  }
  static Control mapped(const Control &k, const double *map) {
    Control out = {};
    for (int i = 0; i < 4; i++)
      for (int j = 0; j < 4; j++) out.c[i] += map[4 * i + j] * k.c[j];
    return out;
  }

  template <class S> void span(Flat<S> &out, double a, double b, const Piece<S> &look) {
    span_start_ = a, span_stop_ = b, gap_ = true;
    double map[16];
    blossom(a, b, map);
    pieces(out, a == 0 && b == 1 ? whole_ : mapped(whole_, map), a, b, 0, look);
  }

public:
  // Visible spans: where margin = Z - near W, a cubic, is positive. Halves intervals until the coefficients agree on a sign; f(a, b) in order.
  template <class Visit> static void visible_spans(const double *margin, Visit f) {
    double open = -1, end = -1;
    auto visit = [&](auto &self, const double *g, double a, double b, int depth) -> void {
      const bool up = g[0] > 0 && g[1] > 0 && g[2] > 0 && g[3] > 0, down = g[0] <= 0 && g[1] <= 0 && g[2] <= 0 && g[3] <= 0;
      if (up) {
        if (open < 0) open = a;
        end = b;
        return;
      }
      if (down || depth == MAX_DEPTH) {
        if (open >= 0) f(open, end);
        open = -1;
        return;
      }
      const double p01 = (g[0] + g[1]) / 2, p12 = (g[1] + g[2]) / 2, p23 = (g[2] + g[3]) / 2, p = (p01 + p12) / 2, q = (p12 + p23) / 2;
      const double m = (p + q) / 2, l[4] = {g[0], p01, p, m}, r[4] = {m, q, p23, g[3]};
      self(self, l, a, (a + b) / 2, depth + 1), self(self, r, (a + b) / 2, b, depth + 1);
    };
    visit(visit, margin, 0, 1, 0);
    if (open >= 0) f(open, end);
  }

  // outline: chords turn little, as the Monte Carlo boundary samples need.
  Flattener(int height, int width, bool outline) : reach_(0), outline_(outline) {
    left_ = top_ = 0, right_ = width, bottom_ = height;
  }

  // Adds one stroke: cubic 4 x (X, Y, Z, W), normalised so that the largest W is 1. reach: px beyond which nothing is covered.
  template <class S> void add(Flat<S> &out, const double *cubic, double near, double reach, uint32_t stroke, const Piece<S> &look) {
    double margin[4];
    for (int i = 0; i < 4; i++) {
      whole_.c[i] = v4d{cubic[4 * i], cubic[4 * i + 1], cubic[4 * i + 2], cubic[4 * i + 3]};
      margin[i] = whole_.c[i][2] - near * whole_.c[i][3];
    }
    const double old = reach_;
    left_ -= reach - old, top_ -= reach - old, right_ += reach - old, bottom_ += reach - old;
    reach_ = reach, stroke_ = stroke, bend_ = 0, cuts_ = 0, gap_ = true;
    visible_spans(margin, [&](double a, double b) { span(out, a, b, look); });
  }
};
}  // namespace stroke
