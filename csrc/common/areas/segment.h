// Segments of contours, and how many chords stand for one. As flat_contours.py has it.
#pragma once
#include "common/scalar.h"
// Of functions that are called in many places and do much: the CUDA kernels would take half a minute to compile with them inlined.
#ifdef __CUDACC__
#define APART __noinline__
#else
#define APART inline
#endif

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
  const int *inner, *contours, *layers, *paints;
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
inline double norm(Point a) { return sqrt(dot(a, a)); }
APART double between(Point a, Point b) { return atan2(abs(cross(a, b)), dot(a, b)); }
APART Point rotated(Point a, double angle) {
  const double c = cos(angle), s = sin(angle);
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
    return sqrt((a + d) / 2 + sqrt((a - d) * (a - d) / 4 + b * b));
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
  APART Point at(double t) const {
    Point q = {0, 0};
    for (int i = 0; i <= degree; i++) q = q + basis(i, t) * p[i];
    return q;
  }
  APART double width(double t) const {
    double q = 0;
    for (int i = 0; i <= degree; i++) q += basis(i, t) * w[i];
    return max(q, 0.0);
  }
  APART Point speed(double t) const {
    Point q = {0, 0};
    for (int i = 0; i <= degree; i++) q = q + rate(i, t) * p[i];
    return q;
  }
  double widest() const {
    double r = w[0];
    for (int i = 1; i <= degree; i++) r = max(r, w[i]);
    return r;
  }
  double reach() const {
    double r = 0;
    for (int i = 1; i <= degree; i++) r = max(r, norm(p[i] - p[0]));
    return r;
  }
  double turn() const {
    double sum = 0;
    for (int i = 2; i <= degree; i++) sum += between(p[i - 1] - p[i - 2], p[i] - p[i - 1]);
    return sum;
  }
};

// The angle that a chord of a circle of this radius may span.
inline double chord_angle(double half_width) { return half_width > 0 ? min(sqrt(8 * TOLERANCE / half_width), PI / 2) : PI / 2; }
// How many chords stand for a segment: flat_contours.py says why.
APART int chord_count(const Segment &s, double scale, bool stroke) {
  double count = 1;
  if (s.degree > 1) {
    double second = 0;
    for (int i = 2; i <= s.degree; i++) second = max(second, norm(s.p[i] - 2 * s.p[i - 1] + s.p[i - 2]));
    count = sqrt(s.degree * (s.degree - 1) / 8.0 * second * scale / TOLERANCE);
    if (stroke) count = max(count, s.turn() / chord_angle(s.widest() * scale));
  }
  return int(clamp(ceil(count), 1.0, double(MOST_CHORDS)));
}
}  // namespace stroke::areas
