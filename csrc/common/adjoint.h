// Derivatives of one fragment or outline point with respect to its piece, and from a piece to its stroke's control points (eq. 5, 6, 12).
#pragma once
#include "common/coverage.h"

namespace stroke {

// Sums over the fragments of one piece: the gradient with respect to the coefficients x, y, z, w, then to the half width's, the opacity
// and the colour; of oblong pieces also to T (2, 2), row by row, where Square changes by T times itself. What is kept of each tile is NGRAD of
// them, and the last four only if they are wanted.
constexpr int NGRAD = 24, OF_WIDTH = 16, OF_OPACITY = 20, OF_COLOR = 21, OF_SQUARE = 24, NSUMS = 28;
template <class F> struct Moments {
  F x[4], y[4], z[4], w[4], half_width[4], opacity, rgb[3], square[4];
};
// Adds what says that the vector (x, y) would change by T (x, y): g = dL/d(that vector).
template <class F> HD void add_square(Moments<F> &m, F gx, F gy, F x, F y) {
  m.square[0] += gx * x, m.square[1] += gx * y, m.square[2] += gy * x, m.square[3] += gy * y;
}

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

// Gradient of the parameter of a closest point (eq. 6): g = dL/dtau; qx, qy relative to o. Free parameters only. Returns -g over the slope of the
// stationary equation.
template <class F, class S> HD F parameter_adjoint(const Jet<F> &j, F tau, F qx, F qy, F g, Moments<F> &m, S one) {
  const F sx = j.px - qx, sy = j.py - qy, iz = S(1) / j.z;
  const F vv = j.vx * j.vx + j.vy * j.vy, f2 = vv + S(2) * (sx * j.ax + sy * j.ay);
  const auto free = (f2 > S(1e-6) * vv) & (tau > S(-.5)) & (tau < S(.5));
  const F e = select(free, -g * iz / (select(free, f2, f2 * S(0) + one)), g * S(0));
  const F mx = j.vx - sx * j.z1 * iz, my = j.vy - sy * j.z1 * iz;
  add_value<false>(m, tau, e * mx, e * my, -e * (mx * j.px + my * j.py), e);
  add_slope(m, tau, e * sx, e * sy, -e * (sx * j.px + sy * j.py), one);
  return e * j.z;
}

// Adds g = dL/d(depth) of a hit: depth = z / w at tau, or w / z in an orthographic view, and tau moves. ALONG: gr is dL/d(half width polynomial),
// which changes with tau too. gt: what else dL/dtau holds, of an oblong piece.
template <int WIDTH, class F, class S> HD void depth_adjoint(const Piece<S> &c, F tau, F qx, F qy, F g, F gr, Moments<F> &m, S one, F gt = F{}) {
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
  if ((WIDTH & OBLONG) == 0 || !c.oblong) {
    parameter_adjoint(j, tau, qx, qy, moved, m, one);
    return;
  }
  const F e = parameter_adjoint(j, tau, qx, qy, moved + gt, m, one), sx = e * (j.px - qx), sy = e * (j.py - qy);
  add_square(m, e * j.vx, e * j.vy, j.px - qx, j.py - qy), add_square(m, sx, sy, j.vx, j.vy);
}

// Adds one fragment of an oblong piece. Its distance from the edge in pixels changes with the direction too (eq. 8b).
template <int WIDTH, class F, class S> HD void oblong_adjoint(const Piece<S> &c, const Filter<S> &f, F tau, F qx, F qy, F ga, F gz, Moments<F> &m) {
  const Across<F> a = across(c, tau, qx, qy);
  const F px = a.j.px, py = a.j.py, ex = qx - px, ey = qy - py, iz = S(1) / a.j.z, zero = ga * S(0);
  const Fragment<F> g = fragment<WIDTH>(c, f, tau, a.j.z, sqrt(ex * ex + ey * ey));
  const F inside = (g.r - g.d) * a.pixels, beyond = (-g.r - g.d) * a.pixels;
  m.opacity += (cumulative(f, inside) - cumulative(f, beyond)) * ga;
  const F gc = ga * c.opacity, inner = gc * density(f, inside), outer = gc * density(f, beyond);
  const F gr = (inner + outer) * a.pixels, k = (inner - outer) * a.pixels / max(g.d, zero + S(1e-6));
  // Of the direction: n turns with the tangent, or with the way to the pixel.
  const F of_log = (outer * beyond - inner * inside) * a.pixels * a.pixels, of_angle = of_log * (a.yy * a.nx - a.yx * a.ny);
  const F turn = of_angle * a.of_tangent, swing = of_angle * a.of_way;
  const F nx = turn * a.nx, ny = turn * a.ny, wx = k * ex + swing * a.ny, wy = k * ey - swing * a.nx;
  const F hx = (wx - nx * a.j.z1 * iz) * iz, hy = (wy - ny * a.j.z1 * iz) * iz;
  add_value<false>(m, tau, hx, hy, -(hx * px + hy * py), zero);
  add_slope(m, tau, nx * iz, ny * iz, -(nx * px + ny * py) * iz, S(1));
  add_square(m, -wx, -wy, ex, ey), add_square(m, nx, ny, a.j.vx, a.j.vy), add_square(m, of_log * a.nx, of_log * a.ny, a.yx, a.yy);
  const F of_width = WIDTH & WORLD ? gr / g.depth : gr, moved = S(2) * (nx * a.j.ax + ny * a.j.ay);
  add_width<WIDTH>(m, tau, of_width);
  depth_adjoint<WIDTH>(c, tau, qx, qy, WIDTH & WORLD ? gz - gr * g.r / g.depth : gz, of_width, m, S(1), moved);
}

// Adds one fragment: ga = dL/d(alpha), gz = dL/d(depth of the hit) (DEPTH only). The distance needs no derivative of tau (eq. 5).
template <int WIDTH, bool DEPTH, class F, class S>
HD void fragment_adjoint(const Piece<S> &c, const Filter<S> &f, F tau, F qx, F qy, F ga, F gz, Moments<F> &m) {
  if ((WIDTH & OBLONG) != 0 && c.oblong) {
    oblong_adjoint<WIDTH>(c, f, tau, qx, qy, ga, gz, m);
    return;
  }
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
  if ((WIDTH & OBLONG) != 0 && c.oblong) {
    const S r = half_width_at<WIDTH>(c, tau, depth_at(c, tau, j.z));
    add_square(m, -g * r * nx, -g * r * ny, ux, uy), add_square(m, g * r * tilt * ux, g * r * tilt * uy, j.vx, j.vy);
  }
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
template <class S, class Of> HD void control_gradient(const S *in, const Piece<Of> &c, S *out) {
  for (int j = 0; j < 4; j++) {
    const S *m = in + 4 * j;
    // Each coefficient by its own name: from a loop over them GCC 12 looks them up in a table that it builds first.
    for (int i = 0; i < 4; i++) out[4 * i + j] = S(bern(i, 0)) * m[0] + S(bern(i, 1)) * m[1] + S(bern(i, 2)) * m[2] + S(bern(i, 3)) * m[3];
  }
  for (int i = 0; i < 4; i++) {
    if (c.oblong) square_of(c).transpose().map(out[4 * i], out[4 * i + 1]);
    out[4 * i + 2] -= S(c.ox) * out[4 * i] + S(c.oy) * out[4 * i + 1];
  }
}
// From the gradient of T to that of Square, which changes by T times itself.
HD void square_gradient(const double *square, const double *of_t, double *out) {
  const Square<double> back = Square<double>{{square[0], square[1], square[2], square[3]}}.inverse();
  for (int row = 0; row < 2; row++)
    for (int k = 0; k < 2; k++) out[2 * row + k] = of_t[2 * row] * back.v[2 * k] + of_t[2 * row + 1] * back.v[2 * k + 1];
}
// From the sums of one piece to the gradient of the four half widths at the control points: of the polynomial's coefficients.
template <class S> HD void width_gradient(const S *m, S *out) {
  for (int i = 0; i < 4; i++) out[i] = S(bern(i, 0)) * m[0] + S(bern(i, 1)) * m[1] + S(bern(i, 2)) * m[2] + S(bern(i, 3)) * m[3];
}
}  // namespace stroke
