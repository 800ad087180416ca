// Coverage: the fraction of a pixel that a stroke covers, from the distance to its closest point (docs/explanation/mathematics.md, eq. 7).
#pragma once
#include "common/curve.h"

namespace stroke {

constexpr double BLUR_REACH = 3.5;                   // the normal distribution is cut here ...
constexpr double BLUR_TAIL = 2.3262907903552504e-4;  // ... where it still has this much, given back by scaling
constexpr double MIN_ALPHA = 1e-6;                   // pixels with less ink than this have no depth

// Pixel filter (eq. 7): the box (inv_sigma = 0) or a normal distribution.
template <class S> struct Filter {
  S inv_sigma, reach;
};
// The filter's integral F(x) and density F'(x), x in px.
template <class F, class S> HD F cumulative(const Filter<S> &f, F x) {
  if (f.inv_sigma == S(0)) return clamp(x + S(.5), S(0), S(1));
  // Abramowitz and Stegun 26.2.17, absolute error 7.5e-8.
  const F y = x * f.inv_sigma, m = max(y, -y), k = S(1) / (S(1) + S(.2316419) * m);
  const F density = exp(clamp(S(-.5) * m * m, S(-70), S(0))) * S(.3989422804014327);
  const F upper = density * k * (S(.319381530) + k * (S(-.356563782) + k * (S(1.781477937) + k * (S(-1.821255978) + k * S(1.330274429)))));
  const F phi = select(y > S(0), S(1) - upper, upper);
  return clamp((phi - S(BLUR_TAIL)) * S(1 / (1 - 2 * BLUR_TAIL)), S(0), S(1));
}
template <class F, class S> HD F density(const Filter<S> &f, F x) {
  if (f.inv_sigma == S(0)) return select((x > S(-.5)) & (x < S(.5)), x * S(0) + S(1), x * S(0));
  const F y = x * f.inv_sigma;
  const F d = exp(clamp(S(-.5) * y * y, S(-70), S(0))) * (S(.3989422804014327 / (1 - 2 * BLUR_TAIL)) * f.inv_sigma);
  return select((y > S(-BLUR_REACH)) & (y < S(BLUR_REACH)), d, x * S(0));
}

// Calls f with the kind of width as a constant.
template <int WIDTH> struct WidthOf {
  HD constexpr operator int() const { return WIDTH; }
};
template <class Call> HD void with_width(bool world, bool along, bool oblong, Call f) {
  if (oblong) world ? f(WidthOf<OBLONG | WORLD | ALONG>{}) : f(WidthOf<OBLONG | ALONG>{});  // one number is such a cubic too
  else if (along) world ? f(WidthOf<WORLD | ALONG>{}) : f(WidthOf<ALONG>{});
  else world ? f(WidthOf<WORLD>{}) : f(WidthOf<EVEN>{});
}
// The half width in px at tau, where the depth is this.
template <int WIDTH, class F, class S> HD F half_width_at(const Piece<S> &c, F tau, F depth) {
  if constexpr ((WIDTH & ALONG) != 0) return WIDTH & WORLD ? cubic(c.half_width, tau) / depth : cubic(c.half_width, tau);
  else return WIDTH & WORLD ? c.half_width[0] / depth : c.half_width[0] + tau * S(0);
}

// One fragment: a pixel d px from its closest point, which is at tau, z. r = half width in px there.
template <class F> struct Fragment {
  F depth, r, d, coverage;
};
template <int WIDTH, class F, class S> HD Fragment<F> fragment(const Piece<S> &c, const Filter<S> &f, F tau, F z, F d) {
  Fragment<F> g;
  g.depth = depth_at(c, tau, z);
  g.r = half_width_at<WIDTH>(c, tau, g.depth);
  g.d = d;
  g.coverage = cumulative(f, g.r - g.d);
  // Only a stroke thinner than the filter reaches leaves a pixel uncovered on its far side.
  if (WIDTH != EVEN || c.half_width[0] < f.reach) g.coverage = g.coverage - cumulative(f, -g.r - g.d);
  return g;
}

// Of the point at tau of an oblong piece: the unit vector n, at which distances are measured from there to (qx, qy), y = S S^T n (S: Square), and the
// pixels of a unit along n, 1 / |S^T n|. In the middle of the piece n is across the tangent, which is as true and has digits on the centre line too.
// n turns by of_tangent times a change of the velocity along n, or by of_way times a change of the way to (qx, qy) across it: one of them is 0.
template <class F> struct Across {
  F nx, ny, yx, yy, pixels, of_tangent, of_way;
  Jet<F> j;
};
constexpr double NO_DIRECTION = 1e-3;  // px: ways, and pieces, that are too short to say where from, or where to (empirical)
template <class F, class S> HD Across<F> across(const Piece<S> &c, F tau, F qx, F qy) {
  Across<F> a;
  a.j = jet(c, tau);
  const F ex = qx - a.j.px, ey = qy - a.j.py, zero = tau * S(0), one = zero + S(1), least2 = zero + S(NO_DIRECTION * NO_DIRECTION);
  const F speed2 = a.j.vx * a.j.vx + a.j.vy * a.j.vy, d2 = ex * ex + ey * ey;
  const auto near = d2 < least2;
  const auto tangent = (speed2 > least2) & (((tau > S(-.5)) & (tau < S(.5))) | near);
  const F by_tangent = S(1) / sqrt(max(speed2, least2)), by_way = S(1) / sqrt(max(d2, least2));
  a.of_tangent = select(tangent, by_tangent, zero), a.of_way = select(tangent, zero, select(near, zero, by_way));
  a.nx = select(tangent, -a.j.vy * by_tangent, select(near, one, ex * by_way));
  a.ny = select(tangent, a.j.vx * by_tangent, select(near, zero, ey * by_way));
  const Square<S> s = square_of(c);
  F mx = a.nx, my = a.ny;
  s.transpose().map(mx, my);
  a.pixels = S(1) / sqrt(mx * mx + my * my);
  s.map(mx, my);
  a.yx = mx, a.yy = my;
  return a;
}
// The fragment of a pixel at (qx, qy). Coverage is by distances in pixels.
template <int WIDTH, class F, class S> HD Fragment<F> fragment_at(const Piece<S> &c, const Filter<S> &f, F tau, F z, F d, F qx, F qy) {
  Fragment<F> g = fragment<WIDTH>(c, f, tau, z, d);
  if ((WIDTH & OBLONG) != 0 && c.oblong) {
    const F pixels = across(c, tau, qx, qy).pixels;
    g.coverage = cumulative(f, (g.r - g.d) * pixels) - cumulative(f, (-g.r - g.d) * pixels);
  }
  return g;
}
}  // namespace stroke
