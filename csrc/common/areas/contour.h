// Contours as polygons: their vertices as functions of control points and half widths, and gradients back. As flat_contours.py has it.
#pragma once
#include "common/areas/segment.h"

namespace stroke::areas {
// A vertex: of a segment at t, and from there half a width along the unit vector u, which turns with the curve or does not.
struct Vertex {
  double x, y, t;
  Point u;
  int segment;
  bool turns;
};
// Polygons are closed, and no two share a vertex: an edge is named by the vertex that it begins at. -1: there is no edge.
struct Link {
  int next, previous;
};

// The places between which chords stand for a segment, found when they are asked for.
struct Along {
  Segment s;
  int segment, count;
  double still;  // what is slower has no direction of its own

  Along(const Segment &s, int segment, double scale) : s(s), segment(segment), count(chord_count(s, scale, true)), still(STILL * s.reach()) {}
  double t(int k) const { return double(k) / count; }
  Point center(int k) const { return s.at(t(k)); }
  double width(int k) const { return s.width(t(k)); }
  bool turns(int k) const { return norm(s.speed(t(k))) >= still; }
  APART Point tangent(int k) const {
    const Point speed = s.speed(t(k)), direction = norm(speed) >= still ? speed : center(k < count ? k + 1 : k) - center(k ? k - 1 : k);
    const double length = norm(direction);
    return length > 0 ? (1 / length) * direction : Point{0, 0};
  }
  // How far chord k turns.
  APART double bend(int k) const { return between(tangent(k), tangent(k + 1)); }
};

// Writes the polygons of a layer's segments to a sink: reserve(n) gives the index of the first of n vertices, each(n, f) does f(k) for all k below n
// in any order, any(n, f) says whether one is true, put(index, vertex) and edge(a, b) write. Polygons of strokes all wind the same way, so that
// nonzero winding numbers give their union.
template <class Sink> class Outliner {
  Matrix matrix_;
  double scale_;
  Sink &sink_;

  APART void put(int v, int segment, double t, Point center, double width, Point u, bool turns) {
    const Point q = matrix_(center + width * u);
    sink_.put(v, {q.x, q.y + SHEAR * q.x, t, u, segment, turns});
  }
  template <class A> void put(int v, const A &a, int k, double width, Point u) { put(v, a.segment, a.t(k), a.center(k), width, u, a.turns(k)); }
  template <class A> void put_center(int v, const A &a, int k) { put(v, a.segment, a.t(k), a.center(k), 0, {0, 0}, false); }
  void edge(int a, int b) { sink_.edge(a, b); }

  // An arc around chord end k, from an angle against the direction there on; with the centre if it is no half circle.
  template <class A> APART void arc(const A &a, int k, double from, double sweep, bool pie) {
    const Point tangent = a.tangent(k);
    const double width = a.width(k);
    const int n = least(int(ceil(sweep / chord_angle(width * scale_))), MOST_CHORDS), first = sink_.reserve(n + 1 + pie), last = first + n + pie;
    sink_.each(n + 1, [&](int j) {
      put(first + j, a, k, width, rotated(tangent, from + sweep * j / n));
      if (j) edge(first + j - 1, first + j);
      else edge(last, first);
      if (j == n && pie) put_center(last, a, k), edge(first + n, last);
    });
  }
  APART void disc(int segment, double t, Point center, double width) {
    if (width <= 0) return;
    const int n = least(int(ceil(2 * PI / chord_angle(width * scale_))), MOST_CHORDS), first = sink_.reserve(n);
    sink_.each(n, [&](int j) {
      put(first + j, segment, t, center, width, {cos(2 * PI * j / n), sin(2 * PI * j / n)}, false);
      edge(first + j, first + (j + 1) % n);
    });
  }
  template <class A> APART void capsule(const A &a, int k) {
    const Point chord = a.center(k + 1) - a.center(k);
    const double length = norm(chord);
    for (int end = k; end < k + 2; end++) disc(a.segment, a.t(end), a.center(end), a.width(end));
    if (length <= 0) return;
    const Point u = (1 / length) * Point{-chord.y, chord.x};
    const int first = sink_.reserve(4);
    sink_.each(4, [&](int i) {
      const int end = i == 1 || i == 2 ? k + 1 : k;
      put(first + i, a.segment, a.t(end), a.center(end), a.width(end), (i < 2 ? -1 : 1) * u, false);
      edge(first + i, first + (i + 1) % 4);
    });
  }

  // On each side of each chord a quadrilateral between the normals at its ends; edges that two share are left out, the centre line first of all.
  // On the inner side of a bend tighter than the stroke is wide normals end where they meet their neighbours: what they would sweep behind that
  // lies within half a width of the curve elsewhere. A chord that turns by too much is a capsule of its own.
  template <class A> void strip(const A &a) {
    const int n = a.count;
    const double limit = 2 * chord_angle(a.s.widest() * scale_);
    const bool whole = !sink_.any(n, [&](int k) { return a.bend(k) > limit; });
    // Chord k - 1; in front of the first one and behind the last there is none.
    auto broken = [&](int k) { return k < 1 || k > n || (!whole && a.bend(k - 1) > limit); };
    for (int k = 0; k < n; k++)
      if (broken(k + 1)) capsule(a, k);
    for (int side = 0; side < 2; side++) {
      auto normal = [&](int k) { return (side ? -1 : 1) * Point{-a.tangent(k).y, a.tangent(k).x}; };
      auto directed = [&](int p, int q) { side ? edge(q, p) : edge(p, q); };
      // How long the normals at the ends of chord k are where they meet, of which the one at its end or its begin is asked.
      auto meet = [&](int k, Point p, Point q, bool end) {
        const Point chord = a.center(k + 1) - a.center(k);
        const double det = cross(p, q), s = cross(chord, q) / det, r = cross(chord, p) / det;
        return det != 0 && s >= 0 && r >= 0 ? end ? r : s : 1e300;
      };
      const int outer = sink_.reserve(n + 1);
      sink_.each(n + 1, [&](int k) {
        const double width = a.width(k);
        const Point here = normal(k);
        double reach = width;
        if (!broken(k)) reach = min(reach, meet(k - 1, normal(k - 1), here, true));
        if (!broken(k + 1)) reach = min(reach, meet(k, here, normal(k + 1), false)), directed(outer + k + 1, outer + k);
        put(outer + k, a, k, width, (width > 0 ? reach / width : 1) * here);
      });
      for (int k = 0; k <= n; k++) {
        const bool after = broken(k);
        if (after == broken(k + 1)) continue;
        const int center = sink_.reserve(1);
        sink_.each(1, [&](int) {
          put_center(center, a, k);
          after ? directed(outer + k, center) : directed(center, outer + k);
        });
      }
    }
  }

public:
  Outliner(const Matrix &matrix, Sink &sink) : matrix_(matrix), scale_(matrix.scale()), sink_(sink) {}

  // Of segment j, which is one of `count` from `first` on. begin: the vertex that the contour begins with; vertices follow each other.
  void fill(const Segment &s, int j, int first, int count, int begin) {
    if (!s.degree) return;
    const int n = chord_count(s, scale_, false), last = j + 1 == first + count, v = sink_.reserve(n + last);
    sink_.each(n + last, [&](int k) {
      const double t = double(k) / n;
      put(v + k, j, t, k < n ? s.at(t) : s.p[s.degree], 0, {0, 0}, false);
      if (j > first || k) edge(v + k - 1, v + k);
      if (k == n) edge(v + k, begin);
    });
  }
  // The same of a stroke: its strip, and the joint or cap in front of it. segments(i): segment i; places(s, i, scale): its places, as of Along.
  template <class Segments, class Places> void outline(int j, int first, int count, bool closed, const Segments &segments, const Places &places) {
    const Segment s = segments(j);
    if (!(s.reach() > 0)) return disc(j, 0, s.p[0], s.width(0));
    if (s.widest() <= 0) return;
    const auto a = places(s, j, scale_);
    strip(a);
    int previous = j;
    do previous = previous > first ? previous - 1 : first + count - 1;
    while (!(segments(previous).reach() > 0));
    if (previous >= j && !closed) {
      if (a.width(0) > 0) arc(a, 0, PI / 2, PI, false);
    } else {
      const Along before(segments(previous), previous, scale_);
      const Point from = before.tangent(before.count), to = a.tangent(0);
      const double turn = between(from, to);
      if (turn > SMOOTH && a.width(0) > 0) arc(before, before.count, cross(from, to) > 0 ? -PI / 2 : PI / 2 - turn, turn, true);
    }
    if (closed || a.width(a.count) <= 0) return;
    int next = j + 1;
    while (next < first + count && !(segments(next).reach() > 0)) next++;
    if (next == first + count) arc(a, a.count, -PI / 2, PI, false);
  }
};

// Adds what the gradient (g) of a vertex is of its segment's control points, (4, 3): x, y and half width; and of the transform.
APART void back_to_controls(const Vertex &vertex, const Segment &s, const Matrix &matrix, Point g, double *g_controls, double *g_transform) {
  if (g == Point{0, 0}) return;
  const double t = vertex.t, width = s.width(t);
  const Point center = s.at(t), local = center + width * vertex.u, h = matrix.transposed(g);
  for (int k = 0; k < 2; k++) {
    const double gk = k ? g.y : g.x;
    g_transform[3 * k] += gk * local.x, g_transform[3 * k + 1] += gk * local.y, g_transform[3 * k + 2] += gk;
  }
  // A unit vector that turns with the curve turns by the part of the speed's change that is across it.
  Point across = {0, 0};
  if (vertex.turns && width > 0) {
    const Point speed = s.speed(t);
    const double length = norm(speed), angle = width * cross(vertex.u, h);
    across = (angle / (length * length)) * Point{-speed.y, speed.x};
  }
  for (int i = 0; i <= s.degree; i++) {
    const double b = s.basis(i, t), rate = s.rate(i, t);
    g_controls[3 * i] += b * h.x + rate * across.x;
    g_controls[3 * i + 1] += b * h.y + rate * across.y;
    if (width > 0) g_controls[3 * i + 2] += b * dot(vertex.u, h);
  }
}
}  // namespace stroke::areas
