// Contours as polygons: their vertices as functions of control points and half widths, and gradients back. As flat_contours.py has it.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace stroke::areas {
enum Rule { NONZERO, EVEN_ODD, STROKE };
constexpr double TOLERANCE = 0.01, SMOOTH = 1e-3, STILL = 1e-6, PI = 3.14159265358979323846;
constexpr int MOST_CHORDS = 1024;
// Pictures are sheared by so little that a thousand pixels move by a millionth of one: no edge is level then, and each end of one that was moves
// its half of it.
constexpr double SHEAR = 1.0 / (1 << 30);

// The tables of Layers in painted_layers.py, whose indices have been checked there.
template <class S> struct Tables {
  const S *points, *half_widths, *transforms, *axes, *offsets, *colors;
  const int32_t *inner, *contours, *layers, *paints;
  int point_count, layer_count, transform_count, paint_count, stop_count;
};

struct Point {
  double x, y;
  friend Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y}; }
  friend Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
  friend Point operator*(double s, Point a) { return {s * a.x, s * a.y}; }
  friend bool operator==(Point a, Point b) { return a.x == b.x && a.y == b.y; }
};
inline double dot(Point a, Point b) { return a.x * b.x + a.y * b.y; }
inline double cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }
inline double norm(Point a) { return std::sqrt(dot(a, a)); }
inline double between(Point a, Point b) { return std::atan2(std::abs(cross(a, b)), dot(a, b)); }
inline Point rotated(Point a, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * a.x - s * a.y, s * a.x + c * a.y};
}

struct Matrix {
  double xx, xy, x, yx, yy, y;
  template <class S> static Matrix of(const S *m) { return {double(m[0]), double(m[1]), double(m[2]), double(m[3]), double(m[4]), double(m[5])}; }
  Point operator()(Point p) const { return {xx * p.x + xy * p.y + x, yx * p.x + yy * p.y + y}; }
  Point transposed(Point g) const { return {xx * g.x + yx * g.y, xy * g.x + yy * g.y}; }
  // The largest factor by which a length grows.
  double scale() const {
    const double a = xx * xx + yx * yx, d = xy * xy + yy * yy, b = xx * xy + yx * yy;
    return std::sqrt((a + d) / 2 + std::sqrt((a - d) * (a - d) / 4 + b * b));
  }
};

// A segment of a contour: control points `index`, as many as its degree and one.
struct Segment {
  int degree, index[4];
  Point p[4];
  double w[4];
  double basis(int i, double t) const {
    const double s = 1 - t;
    switch (degree) {
    case 0:
      return 1;
    case 1:
      return i ? t : s;
    case 2:
      return i == 0 ? s * s : i == 1 ? 2 * s * t : t * t;
    default:
      return i == 0 ? s * s * s : i == 1 ? 3 * s * s * t : i == 2 ? 3 * s * t * t : t * t * t;
    }
  }
  // Of control point i in the derivative.
  double rate(int i, double t) const {
    const double s = 1 - t;
    switch (degree) {
    case 0:
      return 0;
    case 1:
      return i ? 1 : -1;
    case 2:
      return i == 0 ? -2 * s : i == 1 ? 2 * (s - t) : 2 * t;
    default:
      return i == 0 ? -3 * s * s : i == 1 ? 3 * s * (s - 2 * t) : i == 2 ? 3 * t * (2 * s - t) : 3 * t * t;
    }
  }
  Point at(double t) const {
    Point q = {0, 0};
    for (int i = 0; i <= degree; i++) q = q + basis(i, t) * p[i];
    return q;
  }
  double width(double t) const {
    double q = 0;
    for (int i = 0; i <= degree; i++) q += basis(i, t) * w[i];
    return std::max(q, 0.0);
  }
  Point speed(double t) const {
    Point q = {0, 0};
    for (int i = 0; i <= degree; i++) q = q + rate(i, t) * p[i];
    return q;
  }
  double widest() const { return *std::max_element(w, w + degree + 1); }
  double reach() const {
    double r = 0;
    for (int i = 1; i <= degree; i++) r = std::max(r, norm(p[i] - p[0]));
    return r;
  }
  double turn() const {
    double sum = 0;
    for (int i = 2; i <= degree; i++) sum += between(p[i - 1] - p[i - 2], p[i] - p[i - 1]);
    return sum;
  }
};

// The angle that a chord of a circle of this radius may span.
inline double chord_angle(double half_width) { return half_width > 0 ? std::min(std::sqrt(8 * TOLERANCE / half_width), PI / 2) : PI / 2; }
// How many chords stand for a segment: flat_contours.py says why.
inline int chord_count(const Segment &s, double scale, bool stroke) {
  double count = 1;
  if (s.degree > 1) {
    double second = 0;
    for (int i = 2; i <= s.degree; i++) second = std::max(second, norm(s.p[i] - 2 * s.p[i - 1] + s.p[i - 2]));
    count = std::sqrt(s.degree * (s.degree - 1) / 8.0 * second * scale / TOLERANCE);
    if (stroke) count = std::max(count, s.turn() / chord_angle(s.widest() * scale));
  }
  return int(std::clamp(std::ceil(count), 1.0, double(MOST_CHORDS)));
}

// A vertex: of a segment at t, and from there half a width along the unit vector u, which turns with the curve or does not.
struct Vertex {
  double x, y, t;
  Point u;
  int segment;
  bool turns;
};
struct Edge {
  int a, b;
};

// The polygons of one layer. Those of strokes all wind the same way, so that nonzero winding numbers give their union.
template <class S> class Polygons {
  const Tables<S> &tables_;
  Matrix matrix_;
  double scale_;
  bool stroke_;

  struct Along {  // a segment's chords
    int segment, count;
    std::vector<Point> center, tangent;
    std::vector<double> width;
    std::vector<char> turns;
    double t(int k) const { return double(k) / count; }
  };

  int add(int segment, double t, Point center, double width, Point u, bool turns) {
    const Point q = matrix_(center + width * u);
    vertices.push_back({q.x, q.y + SHEAR * q.x, t, u, segment, turns});
    return int(vertices.size()) - 1;
  }
  int add(const Along &a, int k, Point u) { return add(a.segment, a.t(k), a.center[k], a.width[k], u, a.turns[k]); }
  void edge(int a, int b) { edges.push_back({a, b}); }

  Segment segment(int start, int points, int at, int inner) const {
    Segment s;
    s.degree = inner + 1;
    for (int i = 0; i <= s.degree; i++) {
      const int k = s.index[i] = start + (at + i) % points;
      s.p[i] = {double(tables_.points[2 * k]), double(tables_.points[2 * k + 1])}, s.w[i] = double(tables_.half_widths[k]);
    }
    return s;
  }

  void fill(int first, int count) {
    const int begin = int(vertices.size());
    for (int j = first; j < first + count; j++) {
      const Segment &s = segments[j];
      if (!s.degree) return;
      const int n = chord_count(s, scale_, false);
      for (int k = 0; k < n; k++) add(j, double(k) / n, s.at(double(k) / n), 0, {0, 0}, false);
    }
    const Segment &last = segments[first + count - 1];
    add(first + count - 1, 1, last.p[last.degree], 0, {0, 0}, false);
    for (int k = begin; k < int(vertices.size()); k++) edge(k, k + 1 < int(vertices.size()) ? k + 1 : begin);
  }

  // An arc around chord end k, from an angle against the direction there on; with the centre if it is no half circle.
  void arc(const Along &a, int k, double from, double sweep, bool pie) {
    const int n = std::min(int(std::ceil(sweep / chord_angle(a.width[k] * scale_))), MOST_CHORDS);
    const int first = int(vertices.size());
    for (int j = 0; j <= n; j++) add(a, k, rotated(a.tangent[k], from + sweep * j / n));
    for (int j = 0; j < n; j++) edge(first + j, first + j + 1);
    if (!pie) return edge(first + n, first);
    const int center = add(a.segment, a.t(k), a.center[k], 0, {0, 0}, false);
    edge(first + n, center), edge(center, first);
  }
  void disc(int segment, double t, Point center, double width) {
    if (width <= 0) return;
    const int n = std::min(int(std::ceil(2 * PI / chord_angle(width * scale_))), MOST_CHORDS), first = int(vertices.size());
    for (int j = 0; j < n; j++) add(segment, t, center, width, {std::cos(2 * PI * j / n), std::sin(2 * PI * j / n)}, false);
    for (int j = 0; j < n; j++) edge(first + j, first + (j + 1) % n);
  }

  Along along(int j) const {
    const Segment &s = segments[j];
    const int n = chord_count(s, scale_, true);
    Along a{j, n, std::vector<Point>(n + 1), std::vector<Point>(n + 1), std::vector<double>(n + 1), std::vector<char>(n + 1)};
    for (int k = 0; k <= n; k++) a.center[k] = s.at(a.t(k)), a.width[k] = s.width(a.t(k));
    for (int k = 0; k <= n; k++) {
      const Point speed = s.speed(a.t(k));
      a.turns[k] = norm(speed) >= STILL * s.reach();
      const Point direction = a.turns[k] ? speed : a.center[std::min(k + 1, n)] - a.center[std::max(k - 1, 0)];
      const double length = norm(direction);
      a.tangent[k] = length > 0 ? (1 / length) * direction : Point{0, 0};
    }
    return a;
  }

  // On each side of each chord a quadrilateral between the normals at its ends; edges that two share are left out, the centre line first of all.
  // On the inner side of a bend tighter than the stroke is wide normals end where they meet their neighbours: what they would sweep behind that
  // lies within half a width of the curve elsewhere. A chord that turns by too much is a capsule of its own.
  void strip(const Along &a, double limit) {
    const int n = a.count;
    std::vector<char> broken(n + 2, 1);  // chord k - 1; in front of the first one and behind the last there is none
    for (int k = 0; k < n; k++) {
      broken[k + 1] = between(a.tangent[k], a.tangent[k + 1]) > limit;
      if (broken[k + 1]) capsule(a, k);
    }
    std::vector<int> outer(n + 1);
    std::vector<double> reach(n + 1);
    for (int side : {0, 1}) {
      auto normal = [&](int k) { return (side ? -1 : 1) * Point{-a.tangent[k].y, a.tangent[k].x}; };
      auto directed = [&](int p, int q) { side ? edge(q, p) : edge(p, q); };
      reach = a.width;
      for (int k = 0; k < n; k++) {
        const Point p = normal(k), q = normal(k + 1), chord = a.center[k + 1] - a.center[k];
        const double det = cross(p, q), s = cross(chord, q) / det, r = cross(chord, p) / det;
        if (!broken[k + 1] && det != 0 && s >= 0 && r >= 0) reach[k] = std::min(reach[k], s), reach[k + 1] = std::min(reach[k + 1], r);
      }
      for (int k = 0; k <= n; k++) outer[k] = add(a, k, (a.width[k] > 0 ? reach[k] / a.width[k] : 1) * normal(k));
      for (int k = 0; k < n; k++)
        if (!broken[k + 1]) directed(outer[k + 1], outer[k]);
      for (int k = 0; k <= n; k++) {
        if (broken[k] == broken[k + 1]) continue;
        const int center = add(a.segment, a.t(k), a.center[k], 0, {0, 0}, false);
        broken[k] ? directed(outer[k], center) : directed(center, outer[k]);
      }
    }
  }
  void capsule(const Along &a, int k) {
    const Point chord = a.center[k + 1] - a.center[k];
    const double length = norm(chord);
    for (int end : {k, k + 1}) disc(a.segment, a.t(end), a.center[end], a.width[end]);
    if (length <= 0) return;
    const Point u = (1 / length) * Point{-chord.y, chord.x};
    int corners[4];
    for (int i = 0; i < 4; i++) {
      const int end = i == 1 || i == 2 ? k + 1 : k;
      corners[i] = add(a.segment, a.t(end), a.center[end], a.width[end], (i < 2 ? -1 : 1) * u, false);
    }
    for (int i = 0; i < 4; i++) edge(corners[i], corners[(i + 1) % 4]);
  }

  void outline(int first, int count, bool closed) {
    std::vector<Along> ways;
    for (int j = first; j < first + count; j++) {
      const Segment &s = segments[j];
      if (s.reach() > 0) ways.push_back(along(j));
      else disc(j, 0, s.p[0], s.width(0));
    }
    for (size_t i = 0; i < ways.size(); i++) {
      const Along &a = ways[i], &before = ways[(i + ways.size() - 1) % ways.size()];
      const int n = a.count;
      if (segments[a.segment].widest() <= 0) continue;
      strip(a, 2 * chord_angle(segments[a.segment].widest() * scale_));
      if (!i && !closed) {
        if (a.width[0] > 0) arc(a, 0, PI / 2, PI, false);
      } else if (const double turn = between(before.tangent[before.count], a.tangent[0]); turn > SMOOTH && a.width[0] > 0) {
        const bool left = cross(before.tangent[before.count], a.tangent[0]) > 0;
        arc(before, before.count, left ? -PI / 2 : PI / 2 - turn, turn, true);
      }
      if (i + 1 == ways.size() && !closed && a.width[n] > 0) arc(a, n, -PI / 2, PI, false);
    }
  }

public:
  std::vector<Segment> segments;
  std::vector<Vertex> vertices;
  std::vector<Edge> edges;

  Polygons(const Tables<S> &tables, const int32_t *layer)
      : tables_(tables), matrix_(Matrix::of(tables.transforms + 6 * layer[3])), scale_(matrix_.scale()), stroke_(layer[2] == STROKE) {
    for (int contour = layer[0]; contour < layer[0] + layer[1]; contour++) {
      const int32_t *c = tables.contours + 5 * contour;
      const int start = c[0], points = c[1], first = int(segments.size());
      if (!points) continue;
      for (int j = 0, at = 0; j < c[3]; j++) {
        segments.push_back(segment(start, points, at, tables.inner[c[2] + j]));
        at += segments.back().degree;
      }
      if (!c[3]) segments.push_back(segment(start, points, 0, -1));
      const int count = int(segments.size()) - first;
      stroke_ ? outline(first, count, c[4]) : fill(first, count);
    }
  }

  // The vertices of an edge from the top to the bottom; sign 1 if it is directed so, -1 if not, 0 for a level one.
  struct Downwards {
    int upper, lower, sign;
  };
  Downwards downwards(int e) const {
    const auto [a, b] = edges[e];
    const double ya = vertices[a].y, yb = vertices[b].y;
    return ya <= yb ? Downwards{a, b, ya < yb} : Downwards{b, a, -1};
  }

  // From gradients of the vertices to those of each segment's control points, (4, 3) a segment: x, y and half width; and of the transform.
  void backward(const double *g_vertices, double *g_controls, double *g_transform) const {
    for (size_t v = 0; v < vertices.size(); v++) {
      const Vertex &vertex = vertices[v];
      const Point g = {g_vertices[2 * v], g_vertices[2 * v + 1]};
      if (g == Point{0, 0}) continue;
      const Segment &s = segments[vertex.segment];
      const double t = vertex.t, width = s.width(t);
      const Point center = s.at(t), local = center + width * vertex.u, h = matrix_.transposed(g);
      for (int k : {0, 1}) {
        const double gk = k ? g.y : g.x;
        g_transform[3 * k] += gk * local.x, g_transform[3 * k + 1] += gk * local.y, g_transform[3 * k + 2] += gk;
      }
      double *controls = g_controls + 12 * vertex.segment;
      // A unit vector that turns with the curve turns by the part of the speed's change that is across it.
      Point across = {0, 0};
      if (vertex.turns && width > 0) {
        const Point speed = s.speed(t);
        const double length = norm(speed), angle = width * cross(vertex.u, h);
        across = (angle / (length * length)) * Point{-speed.y, speed.x};
      }
      for (int i = 0; i <= s.degree; i++) {
        const double b = s.basis(i, t), rate = s.rate(i, t);
        controls[3 * i] += b * h.x + rate * across.x;
        controls[3 * i + 1] += b * h.y + rate * across.y;
        if (width > 0) controls[3 * i + 2] += b * dot(vertex.u, h);
      }
    }
  }
};
}  // namespace stroke::areas
