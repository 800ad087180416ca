// Pieces of rational strokes and their chords: what they are, and their points and derivatives. Equation numbers: docs/explanation/mathematics.md.
//
// A piece is a part of a stroke, tame enough for float32; a chord stands for a part of a piece (common/flatten.h makes both).
#pragma once
#include "common/scalar.h"

namespace stroke {

constexpr int TILE = 16;  // tiles are TILE x TILE pixels
// A tame part of a stroke: four cubics in tau = t - 1/2 (small powers: little cancellation in float32). On screen it is
// o + (x, y) / z, its depth z / w, or w / z in an orthographic view. Of an oblong piece (x, y) / z is where pixels are square.
template <class S> struct Piece {
  S x[4], y[4], z[4], w[4];
  S ox, oy;
  S half_width[4];  // a cubic in tau, or one number and zeros: px, or px times depth where widths are in world units
  S color[3], opacity;
  S flat_w;     // 1 / w where w is constant and depth is z / w, else 0
  S parabola2;  // CPU: square of the parameter step within which the parabola that touches the curve stands for it
  bool orthographic, oblong;
  S square[4];  // of an oblong piece: see Square
};

// A chord of a piece: from a along e; (ix, iy) = e / |e|^2. At its fraction s the curve's parameter is about tau0 + s (dtau + (1 - s) bow): exact
// at the ends and in the middle.
template <class S> struct Chord {
  S ax, ay, ex, ey, ix, iy, tau0, dtau, bow;
};

// How wide strokes are, as bits: px, or WORLD: px times depth; ALONG: a cubic in tau in place of one number; and OBLONG: pieces may be oblong.
enum Width { EVEN = 0, WORLD = 1, ALONG = 2, OBLONG = 4 };
// The map from pixels to a plane where widths in world units are round, though pixels may be oblong there: (2, 2), row by row, no length shrinks
// in it. Distances, parameters and half widths are measured in that plane; o, chords and all else that is compared with the image are in pixels.
template <class S> struct Square {
  S v[4];
  template <class F> HD void map(F &x, F &y) const {
    const F u = v[0] * x + v[1] * y;
    y = v[2] * x + v[3] * y, x = u;
  }
  HD S area() const { return v[0] * v[3] - v[1] * v[2]; }
  HD Square inverse() const { return {{v[3] / area(), -v[1] / area(), -v[2] / area(), v[0] / area()}}; }
  HD Square transpose() const { return {{v[0], v[2], v[1], v[3]}}; }
};
template <class S> HD Square<S> square_of(const Piece<S> &c) { return {{c.square[0], c.square[1], c.square[2], c.square[3]}}; }
template <int WIDTH, class F, class S> HD void to_square(const Piece<S> &c, F &x, F &y) {
  if constexpr ((WIDTH & OBLONG) != 0)
    if (c.oblong) square_of(c).map(x, y);
}
// By how much lengths grow at most.
HD double stretch_of(const double *v) {
  if (!v) return 1;
  return (length(v[0] + v[3], v[1] - v[2]) + length(v[0] - v[3], v[1] + v[2])) / 2;
}
// Where pixels are square a piece is not oblong, unless the gradient of the map is wanted.
template <class S> HD void set_square(Piece<S> &c, const double *v, bool wanted) {
  c.oblong = v && (wanted || !(v[0] == 1 && v[1] == 0 && v[2] == 0 && v[3] == 1));
  for (int k = 0; k < 4; k++) c.square[k] = c.oblong ? S(v[k]) : S(k % 3 == 0);
}

// B_i(t) = sum_k bern(i, k) tau^k.
HD constexpr double bern(int i, int k) {
  constexpr double B[4][4] = {{.125, -.75, 1.5, -1.}, {.375, -.75, -1.5, 3.}, {.375, .75, -1.5, -3.}, {.125, .75, 1.5, 1.}};
  return B[i][k];
}
template <class F, class S> HD F cubic(const S *a, F t) { return ((a[3] * t + a[2]) * t + a[1]) * t + a[0]; }
// With the derivative, and half the second one, by synthetic division.
template <class F, class S> HD F cubic(const S *a, F t, F &slope) {
  const F b = a[3] * t + a[2], c = b * t + a[1];
  slope = (a[3] * t + b) * t + c;
  return c * t + a[0];
}
template <class F, class S> HD F cubic(const S *a, F t, F &slope, F &half_bend) {
  const F b = a[3] * t + a[2], c = b * t + a[1], d = a[3] * t + b;
  slope = d * t + c, half_bend = a[3] * t + d;
  return c * t + a[0];
}

// Squared distance from the point (dx, dy), relative to the start of a chord of a piece; s = place along it, in [0, 1].
template <int WIDTH, class F, class S> HD F chord_dist2(const Piece<S> &piece, const Chord<S> &c, F dx, F dy, F &s) {
  s = clamp(dx * c.ix + dy * c.iy, S(0), S(1));
  F rx = dx - s * c.ex, ry = dy - s * c.ey;
  to_square<WIDTH>(piece, rx, ry);
  return rx * rx + ry * ry;
}

template <class F, class S> HD F chord_tau(const Chord<S> &c, F s) { return c.tau0 + s * ((c.dtau + c.bow) - s * c.bow); }

// Position relative to o, its first derivative and half the second, and z with the first.
template <class F> struct Jet {
  F px, py, vx, vy, ax, ay, z, z1;
};
template <class F, class S> HD Jet<F> jet(const Piece<S> &c, F tau) {
  Jet<F> j;
  F x1, x2, y1, y2, z2;
  j.z = cubic(c.z, tau, j.z1, z2);
  const F iz = S(1) / j.z;
  j.px = cubic(c.x, tau, x1, x2) * iz, j.py = cubic(c.y, tau, y1, y2) * iz;
  j.vx = (x1 - j.px * j.z1) * iz, j.vy = (y1 - j.py * j.z1) * iz;
  j.ax = (x2 - j.vx * j.z1 - j.px * z2) * iz, j.ay = (y2 - j.vy * j.z1 - j.py * z2) * iz;
  return j;
}

// The point of a piece at tau, relative to o.
template <class F> struct Point {
  F tau, x, y, z;
};
template <class F, class S> HD Point<F> point_at(const Piece<S> &c, F tau) {
  const F z = cubic(c.z, tau), iz = S(1) / z;
  return {tau, cubic(c.x, tau) * iz, cubic(c.y, tau) * iz, z};
}
template <class F> HD F distance2(const Point<F> &p, F qx, F qy) { return (p.x - qx) * (p.x - qx) + (p.y - qy) * (p.y - qy); }

template <class F, class S> HD F depth_at(const Piece<S> &c, F tau, F z) {
  if (c.flat_w > S(0)) return z * c.flat_w;
  return c.orthographic ? cubic(c.w, tau) / z : z / cubic(c.w, tau);
}
}  // namespace stroke
