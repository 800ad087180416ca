// Derivatives of one fragment or outline point with respect to its piece, and from a piece to its stroke's control points (eq. 5, 6, 12).
#pragma once
#include "common/coverage.h"

namespace stroke {

// Sums over the fragments of one piece: the gradient with respect to the coefficients x, y, z, w, then to the half width's, the opacity
// and the colour.
constexpr int NGRAD = 24, OF_WIDTH = 16, OF_OPACITY = 20, OF_COLOR = 21;
template <class F> struct Moments {
  F x[4], y[4], z[4], w[4], half_width[4], opacity, rgb[3];
};

// Adds (hx, hy, hz, hw) tau^k to the coefficients.
template <bool W, class F> HD void add_value(Moments<F> &m, F tau, F hx, F hy, F hz, F hw) {
  for (int k = 0; k < 4; k++) {
    m.x[k] += hx, m.y[k] += hy, m.z[k] += hz;
    hx *= tau, hy *= tau, hz *= tau;
    if (W) m.w[k] += hw, hw *= tau;
  }
}
// Adds (hx, hy, hz) k tau^(k-1): what a derivative along the curve adds.
template <class F, class S> HD void add_slope(Moments<F> &m, F tau, F hx, F hy, F hz, S) {
  F power = tau * S(0) + S(1);
  for (int k = 1; k < 4; k++) {
    m.x[k] += S(k) * power * hx, m.y[k] += S(k) * power * hy, m.z[k] += S(k) * power * hz;
    power *= tau;
  }
}

// Adds g = dL/d(half width polynomial at tau).
template <int WIDTH, class F> HD void add_width(Moments<F> &m, F tau, F g) {
  m.half_width[0] += g;
  for (int k = 1; (WIDTH & ALONG) && k < 4; k++) g *= tau, m.half_width[k] += g;
}

// Gradient of the parameter of a closest point (eq. 6): g = dL/dtau; qx, qy relative to o. Free parameters only.
template <class F, class S> HD void parameter_adjoint(const Jet<F> &j, F tau, F qx, F qy, F g, Moments<F> &m, S one) {
  const F sx = j.px - qx, sy = j.py - qy, iz = S(1) / j.z;
  const F vv = j.vx * j.vx + j.vy * j.vy, f2 = vv + S(2) * (sx * j.ax + sy * j.ay);
  const auto free = (f2 > S(1e-6) * vv) & (tau > S(-.5)) & (tau < S(.5));
  const F e = select(free, -g * iz / (select(free, f2, f2 * S(0) + one)), g * S(0));
  const F mx = j.vx - sx * j.z1 * iz, my = j.vy - sy * j.z1 * iz;
  add_value<false>(m, tau, e * mx, e * my, -e * (mx * j.px + my * j.py), e);
  add_slope(m, tau, e * sx, e * sy, -e * (sx * j.px + sy * j.py), one);
}

// Adds g = dL/d(depth) of a hit: depth = z / w at tau, or w / z in an orthographic view, and tau moves. ALONG: gr is dL/d(half width polynomial),
// which changes with tau too.
template <int WIDTH, class F, class S> HD void depth_adjoint(const Piece<S> &c, F tau, F qx, F qy, F g, F gr, Moments<F> &m, S one) {
  const Jet<F> j = jet(c, tau);
  F w1;
  const F w = cubic(c.w, tau, w1), zero = g * S(0);
  F moved;
  if (c.orthographic) {
    const F iz = S(1) / j.z, depth = w * iz;
    add_value<true>(m, tau, zero, zero, -g * depth * iz, g * iz);
    moved = g * (w1 - depth * j.z1) * iz;
  } else {
    const F iw = S(1) / w, depth = j.z * iw;
    add_value<true>(m, tau, zero, zero, g * iw, -g * depth * iw);
    moved = g * (j.z1 - depth * w1) * iw;
  }
  if (WIDTH & ALONG) {
    F slope;
    cubic(c.half_width, tau, slope);
    moved += gr * slope;
  }
  parameter_adjoint(j, tau, qx, qy, moved, m, one);
}

// Adds one fragment: ga = dL/d(alpha), gz = dL/d(depth of the hit) (DEPTH only). The distance needs no derivative of tau (eq. 5).
template <int WIDTH, bool DEPTH, class F, class S>
HD void fragment_adjoint(const Piece<S> &c, const Filter<S> &f, F tau, F qx, F qy, F ga, F gz, Moments<F> &m) {
  const Point<F> p = point_at(c, tau);
  const Fragment<F> g = fragment<WIDTH>(c, f, tau, p.z, sqrt(distance2(p, qx, qy)));
  m.opacity += g.coverage * ga;
  const F inner = density(f, g.r - g.d), gc = ga * c.opacity;
  F gr = gc * inner, gd = gr;
  if (WIDTH != EVEN || c.half_width[0] < f.reach) {
    const F outer = gc * density(f, -g.r - g.d);
    gr += outer, gd = gd - outer;
  }
  const F k = gd / (max(g.d, g.d * S(0) + S(1e-6)) * p.z);
  const F hx = k * (qx - p.x), hy = k * (qy - p.y), hz = -(hx * p.x + hy * p.y);
  add_value<false>(m, tau, hx, hy, hz, hz);
  const F of_width = WIDTH & WORLD ? gr / g.depth : gr;
  add_width<WIDTH>(m, tau, of_width);
  if (WIDTH != EVEN || DEPTH) depth_adjoint<WIDTH>(c, tau, qx, qy, WIDTH & WORLD ? gz - gr * g.r / g.depth : gz, of_width, m, S(1));
}

// Adds g times the normal displacement of an outline point p + r u (eq. 12). along: length of outline per unit of tau (1 at caps), slope:
// dr/dtau (0 at caps and for constant width), both at the point.
template <int WIDTH, class S> HD void outline_adjoint(const Piece<S> &c, S tau, S ux, S uy, S along, S slope, S g, Moments<S> &m) {
  const Jet<S> j = jet(c, tau);
  const S iz = S(1) / j.z, speed = sqrt(j.vx * j.vx + j.vy * j.vy);
  const S tilt = speed > S(0) ? slope / speed : S(0);
  S nx = along * ux - tilt * j.vx, ny = along * uy - tilt * j.vy;  // normal times length
  if (WIDTH != EVEN) {
    const S w = cubic(c.w, tau), depth = j.z / w, r = half_width_at<WIDTH>(c, tau, depth);
    // The unit normal u turns with the tangent.
    const S turn = r * tilt * iz * g;
    add_slope(m, tau, turn * ux, turn * uy, -turn * (ux * j.px + uy * j.py), S(1));
    nx -= r * tilt * j.z1 * iz * ux, ny -= r * tilt * j.z1 * iz * uy;
    if (WIDTH & WORLD) {
      const S gd = -g * along * r / depth;
      add_value<true>(m, tau, S(0), S(0), gd / w, -gd * depth / w);
    }
    add_width<WIDTH>(m, tau, WIDTH & WORLD ? g * along / depth : g * along);
  } else {
    add_width<WIDTH>(m, tau, g * along);
  }
  const S hx = g * nx * iz, hy = g * ny * iz;
  add_value<false>(m, tau, hx, hy, -(hx * j.px + hy * j.py), S(0));
}

// From the sums of one piece to the gradient of its homogeneous control points, 4 x (X, Y, Z, W). in: NGRAD numbers in struct order.
template <class S> HD void control_gradient(const S *in, S ox, S oy, S *out) {
  for (int j = 0; j < 4; j++) {
    const S *m = in + 4 * j;
    // Each coefficient by its own name: from a loop over them GCC 12 looks them up in a table that it builds first.
    for (int i = 0; i < 4; i++) out[4 * i + j] = S(bern(i, 0)) * m[0] + S(bern(i, 1)) * m[1] + S(bern(i, 2)) * m[2] + S(bern(i, 3)) * m[3];
  }
  for (int i = 0; i < 4; i++) out[4 * i + 2] -= ox * out[4 * i] + oy * out[4 * i + 1];
}
// The same for the four half widths at the control points: of the polynomial's coefficients.
template <class S> HD void width_gradient(const S *m, S *out) {
  for (int i = 0; i < 4; i++) out[i] = S(bern(i, 0)) * m[0] + S(bern(i, 1)) * m[1] + S(bern(i, 2)) * m[2] + S(bern(i, 3)) * m[3];
}
}  // namespace stroke
