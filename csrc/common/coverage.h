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

// How wide strokes are, as bits: px, or WORLD: px times depth; and ALONG: a cubic in tau in place of one number.
enum Width { EVEN = 0, WORLD = 1, ALONG = 2 };
// Calls f with the kind of width as a constant.
template <int WIDTH> struct WidthOf {
  HD constexpr operator int() const { return WIDTH; }
};
template <class Call> HD void with_width(bool world, bool along, Call f) {
  if (along) world ? f(WidthOf<WORLD | ALONG>{}) : f(WidthOf<ALONG>{});
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
}  // namespace stroke
