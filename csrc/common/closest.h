// The closest point of a piece to a pixel: Newton's steps from a start on a chord (docs/explanation/mathematics.md, eq. 4).
#pragma once
#include "common/curve.h"

namespace stroke {

constexpr double CHORD_TOL = .12;        // px between chord and curve; Newton makes up for it (empirical: faster than .05, .15 and .5)
constexpr double TIGHT_CHORD_TOL = .05;  // the same in bends as tight as the stroke is wide
// A run of chords that turns less than this, nowhere tighter than TIGHT times the stroke's reach, has one nearest point within its reach: for a
// second the curve would have to turn round. And what lies within reach of a chord has passed those before it, and none behind the next one.
constexpr float SMOOTH_TURN = 1.5f;
constexpr double TIGHT = .75;
// At an end of a piece a curve whose chord turns by more than this times its length over the reach may come near twice within the chord.
constexpr float BENT_END = .3f;  // (empirical)

// Towards the point of the piece nearest to (qx, qy), from a parameter on a chord within CHORD_TOL (eq. 4): a Newton step on half the squared
// distance. d2: the squared distance before; rate: the inverse of the slope there.
template <class F> struct Approach {
  F from, d2, tau, rate;
};
template <class F, class S> HD Approach<F> newton_step(const Piece<S> &c, F from, F qx, F qy, Jet<F> &j) {
  j = jet(c, from);
  const F rx = j.px - qx, ry = j.py - qy;
  const F vv = j.vx * j.vx + j.vy * j.vy + S(1e-30), f2 = vv + S(2) * (rx * j.ax + ry * j.ay);
  // Gauss-Newton where the curvature term would turn the step uphill.
  const F rate = S(1) / select(f2 > S(.1) * vv, f2, vv);
  return {from, rx * rx + ry * ry, clamp(from - (rx * j.vx + ry * j.vy) * rate, S(-.5), S(.5)), rate};
}
template <class F, class S> HD Approach<F> newton_step(const Piece<S> &c, F from, F qx, F qy) {
  Jet<F> j;
  return newton_step(c, from, qx, qy, j);
}

// A second step with the slope of the first, along the tangent. bent: it is too long for the tangent to stand for the curve, or the first led
// uphill.
constexpr double TANGENT_STEP = .001;  // px: 1e-5 px off a bend with a radius of .05 px
template <class F, class S, class M> HD Point<F> tangent_step(const Piece<S> &c, const Approach<F> &a, F qx, F qy, M &bent) {
  F x1, y1, z1;
  const F z = cubic(c.z, a.tau, z1), iz = S(1) / z, px = cubic(c.x, a.tau, x1) * iz, py = cubic(c.y, a.tau, y1) * iz;
  const F vx = (x1 - px * z1) * iz, vy = (y1 - py * z1) * iz, rx = px - qx, ry = py - qy;
  const F next = clamp(a.tau - (rx * vx + ry * vy) * a.rate, S(-.5), S(.5)), step = next - a.tau;
  bent = (step * step * (vx * vx + vy * vy) > S(TANGENT_STEP * TANGENT_STEP)) | (rx * rx + ry * ry > a.d2 * S(1.0001));
  // Depth is no matter of pixels: near a vanishing point it may double within such a step.
  return {next, px + step * vx, py + step * vy, cubic(c.z, next)};
}

// Both steps at once, along the parabola that touches the curve at the start. bent: as above, or the first is too long for the parabola.
template <class F, class S, class M> HD Point<F> two_steps(const Piece<S> &c, F from, F qx, F qy, Approach<F> &a, M &bent) {
  Jet<F> j;
  a = newton_step(c, from, qx, qy, j);
  const F first = a.tau - from, bx = first * j.ax, by = first * j.ay, vv = j.vx * j.vx + j.vy * j.vy;
  const F vx = j.vx + S(2) * bx, vy = j.vy + S(2) * by, rx = j.px - qx + first * (j.vx + bx), ry = j.py - qy + first * (j.vy + by);
  const F next = clamp(a.tau - (rx * vx + ry * vy) * a.rate, S(-.5), S(.5)), step = next - a.tau;
  bent = (step * step * vv > S(TANGENT_STEP * TANGENT_STEP)) | (rx * rx + ry * ry > a.d2 * S(1.0001)) | (first * first > c.parabola2);
  return {next, qx + rx + step * vx, qy + ry + step * vy, cubic(c.z, next)};
}

// A second step with a slope of its own, along the parabola that touches the curve. far: it is too long for that, or does not lead to the nearest
// point, since a third would be felt, or the first led uphill and is taken back.
constexpr double PARABOLA_STEP = .01;  // px (empirical)
constexpr double THIRD_STEP = 1e-4;    // px (empirical: depth's gradient near centres of curvature feels more)
template <class F, class S, class M> HD Point<F> parabola_step(const Piece<S> &c, const Approach<F> &a, F qx, F qy, M &far) {
  const Jet<F> j = jet(c, a.tau);
  const F rx = j.px - qx, ry = j.py - qy, vv = j.vx * j.vx + j.vy * j.vy, f2 = vv + S(2) * (rx * j.ax + ry * j.ay);
  // The slope's inverse, from that of the first by a step of Newton's: a fraction off^2 of the step is missing then.
  const F off = clamp(S(1) - f2 * a.rate, S(-1), S(1)), old = (rx * j.vx + ry * j.vy) * a.rate;
  const F next = clamp(a.tau - (old + old * off), S(-.5), S(.5)), step = next - a.tau, old_step = clamp(a.tau - old, S(-.5), S(.5)) - a.tau;
  const F missing = old_step * off * off;
  const M uphill = rx * rx + ry * ry > a.d2 * S(1.0001);
  far = (step * step * vv > S(PARABOLA_STEP * PARABOLA_STEP)) | (missing * missing * vv > S(THIRD_STEP * THIRD_STEP)) | uphill;
  return {select(uphill, a.from, next), j.px + step * (j.vx + step * j.ax), j.py + step * (j.vy + step * j.ay), cubic(c.z, next)};
}

// A step of Newton's, downhill, if it stays between the parameters last left in either direction, else to the middle of these. moved2: its
// squared length in px along the tangent.
template <class F> struct Bracket {
  F low, high;
};
template <class F, class S> HD F step_between(const Piece<S> &c, Bracket<F> &b, F tau, F qx, F qy, F &moved2) {
  const Jet<F> j = jet(c, tau);
  const F rx = j.px - qx, ry = j.py - qy, slope = rx * j.vx + ry * j.vy, vv = j.vx * j.vx + j.vy * j.vy + S(1e-30);
  const F f2 = vv + S(2) * (rx * j.ax + ry * j.ay);
  const auto rises = slope >= S(0);
  b.low = select(rises, b.low, tau), b.high = select(rises, tau, b.high);
  const F newton = clamp(tau - slope / select(f2 > S(.001) * vv, f2, vv), S(-.5), S(.5));
  const auto between = ((newton > b.low) & (newton < b.high)) | (newton == tau);
  const F next = select(between, newton, clamp((b.low + b.high) * S(.5), S(-.5), S(.5)));
  moved2 = (next - tau) * (next - tau) * vv;
  return next;
}

template <class F, class M> HD Point<F> choose(const M &m, const Point<F> &a, const Point<F> &b) {
  return {select(m, a.tau, b.tau), select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}
// The second and further steps in lanes that are bent; in others whatever comes. enough: px; no fourth step is made behind a shorter one, nor
// any more.
// px: a last step of s px changes a distance d by s^2 / 2d at most, too little to tell two places apart (empirical)
constexpr double ROUGH_STEP = .02;
constexpr int MORE_STEPS = 24;  // halvings of a piece: float32 has no digits left
template <class F, class S, class M>
HD Point<F> more_steps(const Piece<S> &c, const Approach<F> &a, F qx, F qy, const M &bent, S enough = S(TANGENT_STEP)) {
  M far;
  Point<F> point = parabola_step(c, a, qx, qy, far);
  M going = far = far & bent;
  if (any(far)) {
    F tau = point.tau;
    Bracket<F> bracket = {tau * S(0) - S(1), tau * S(0) + S(1)};  // wider than the piece: its ends have not been left yet
    for (int tries = 0; tries < MORE_STEPS && any(going); tries++) {
      F moved2;
      tau = select(going, step_between(c, bracket, tau, qx, qy, moved2), tau);
      going = going & (moved2 > enough * enough);
    }
    point = choose(far, point_at(c, tau), point);
  }
  // In a bend tighter than the distance all may have led astray: then the start is better.
  const M astray = bent & (distance2(point, qx, qy) > a.d2 * S(1.0001));
  return any(astray) ? choose(astray, point_at(c, a.from), point) : point;
}
// The nearest point, behind the first step. in: of interest.
template <class F, class S, class M>
HD Point<F> arrive(const Piece<S> &c, const Approach<F> &a, F qx, F qy, const M &in, S enough = S(TANGENT_STEP)) {
  M bent;
  const Point<F> point = tangent_step(c, a, qx, qy, bent);
  bent = bent & in;
  return any(bent) ? choose(bent, more_steps(c, a, qx, qy, bent, enough), point) : point;
}
}  // namespace stroke
