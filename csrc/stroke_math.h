// Maths of the stroke renderer, shared by every driver (CPU SIMD, CUDA). Equation numbers: docs/explanation/mathematics.md.
//
// Functions are templated on two types: S, the scalar in which strokes are stored, and F, the type in which pixels are processed. The
// CPU driver passes a SIMD vector for F, CUDA a scalar. Branches are written select(mask, a, b), overloaded for both.
#pragma once
#ifdef __CUDACC__  // nvcc and NVRTC
#define HD __host__ __device__ __forceinline__
#else
#define HD inline __attribute__((always_inline))
#endif

namespace stroke {

constexpr int TILE = 16;              // tiles are TILE x TILE pixels
constexpr double CHORD_TOL = .12;     // px between chord and curve; Newton makes up for it (empirical: faster than .05, .15 and .5)
constexpr double TIGHT_CHORD_TOL = .05;  // the same in bends as tight as the stroke is wide
constexpr double BLUR_REACH = 3.5;    // the normal distribution is cut here ...
constexpr double BLUR_TAIL = 2.3262907903552504e-4;  // ... where it still has this much, given back by scaling
constexpr double MIN_ALPHA = 1e-6;    // pixels with less ink than this have no depth
// A run of chords that turns less than this, nowhere tighter than TIGHT times the stroke's reach, has one nearest point within its reach: for a
// second the curve would have to turn round. And what lies within reach of a chord has passed those before it, and none behind the next one.
constexpr float SMOOTH_TURN = 1.5f;
constexpr double TIGHT = .75;
// At an end of a piece a curve whose chord turns by more than this times its length over the reach may come near twice within the chord.
constexpr float BENT_END = .3f;       // (empirical)

HD bool any(bool m) { return m; }
HD float select(bool m, float a, float b) { return m ? a : b; }
HD double select(bool m, double a, double b) { return m ? a : b; }
// What is no number becomes lo, as it does in vectors.
HD float clamp(float x, float lo, float hi) { return x > lo ? x < hi ? x : hi : lo; }
HD double clamp(double x, double lo, double hi) { return x > lo ? x < hi ? x : hi : lo; }
#ifdef __CUDACC__
HD float root(float x) { return sqrtf(x); }
HD double root(double x) { return sqrt(x); }
HD float exponential(float x) { return expf(x); }
HD double exponential(double x) { return exp(x); }
HD double cube_root(double x) { return cbrt(x); }
HD double nearest(double x) { return round(x); }
HD double upwards(double x) { return ceil(x); }
HD double cosine(double x) { return cos(x); }
HD double sine(double x) { return sin(x); }
HD float angle_of(float y, float x) { return atan2f(y, x); }
#else
HD float root(float x) { return __builtin_sqrtf(x); }
HD double root(double x) { return __builtin_sqrt(x); }
HD float exponential(float x) { return __builtin_expf(x); }
HD double exponential(double x) { return __builtin_exp(x); }
HD double cube_root(double x) { return __builtin_cbrt(x); }
HD double nearest(double x) { return __builtin_round(x); }
HD double upwards(double x) { return __builtin_ceil(x); }
HD double cosine(double x) { return __builtin_cos(x); }
HD double sine(double x) { return __builtin_sin(x); }
HD float angle_of(float y, float x) { return __builtin_atan2f(y, x); }
#endif
HD float lesser(float a, float b) { return a < b ? a : b; }
HD double lesser(double a, double b) { return a < b ? a : b; }
HD float greater(float a, float b) { return a > b ? a : b; }
HD double greater(double a, double b) { return a > b ? a : b; }

// A tame part of a stroke: four cubics in tau = t - 1/2 (small powers: little cancellation in float32). On screen it is
// o + (x, y) / z, its depth z / w.
template <class S> struct Piece {
  S x[4], y[4], z[4], w[4];
  S ox, oy;
  S half_width;                       // px, or px times depth where widths are in world units
  S color[3], opacity;
  S flat_w;                           // 1 / w where w is constant, else 0
  S parabola2;                        // CPU: square of the parameter step within which the parabola that touches the curve stands for it
};

// A chord of a piece: from a along e; (ix, iy) = e / |e|^2. At its share s the curve's parameter is about tau0 + s (dtau + (1 - s) bow): exact
// at the ends and in the middle.
template <class S> struct Chord { S ax, ay, ex, ey, ix, iy, tau0, dtau, bow; };

// Pixel filter (eq. 7): the box (inv_sigma = 0) or a normal distribution.
template <class S> struct Filter { S inv_sigma, reach; };

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

// Squared distance from the point (dx, dy), relative to the chord's start; s = place along it, in [0, 1].
template <class F, class S> HD F chord_dist2(const Chord<S> &c, F dx, F dy, F &s) {
  s = clamp(dx * c.ix + dy * c.iy, S(0), S(1));
  const F rx = dx - s * c.ex, ry = dy - s * c.ey;
  return rx * rx + ry * ry;
}

template <class F, class S> HD F chord_tau(const Chord<S> &c, F s) { return c.tau0 + s * ((c.dtau + c.bow) - s * c.bow); }

// Position relative to o, its first derivative and half the second, and z with the first.
template <class F> struct Jet { F px, py, vx, vy, ax, ay, z, z1; };
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
template <class F> struct Point { F tau, x, y, z; };
template <class F, class S> HD Point<F> point_at(const Piece<S> &c, F tau) {
  const F z = cubic(c.z, tau), iz = S(1) / z;
  return {tau, cubic(c.x, tau) * iz, cubic(c.y, tau) * iz, z};
}
template <class F> HD F distance2(const Point<F> &p, F qx, F qy) { return (p.x - qx) * (p.x - qx) + (p.y - qy) * (p.y - qy); }

// Towards the point of the piece nearest to (qx, qy), from a parameter on a chord within CHORD_TOL (eq. 4): a Newton step on half the squared
// distance. d2: the squared distance before; rate: the inverse of the slope there.
template <class F> struct Approach { F from, d2, tau, rate; };
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
constexpr double TANGENT_STEP = .001;    // px: 1e-5 px off a bend with a radius of .05 px
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
constexpr double PARABOLA_STEP = .01;    // px (empirical)
constexpr double THIRD_STEP = 1e-4;      // px (empirical: depth's gradient near centres of curvature feels more)
template <class F, class S, class M> HD Point<F> parabola_step(const Piece<S> &c, const Approach<F> &a, F qx, F qy, M &far) {
  const Jet<F> j = jet(c, a.tau);
  const F rx = j.px - qx, ry = j.py - qy, vv = j.vx * j.vx + j.vy * j.vy, f2 = vv + S(2) * (rx * j.ax + ry * j.ay);
  // The slope's inverse, from that of the first by a step of Newton's: a share of off^2 of the step is missing then.
  const F off = clamp(S(1) - f2 * a.rate, S(-1), S(1)), old = (rx * j.vx + ry * j.vy) * a.rate;
  const F next = clamp(a.tau - (old + old * off), S(-.5), S(.5)), step = next - a.tau, old_step = clamp(a.tau - old, S(-.5), S(.5)) - a.tau;
  const F missing = old_step * off * off;
  const M uphill = rx * rx + ry * ry > a.d2 * S(1.0001);
  far = (step * step * vv > S(PARABOLA_STEP * PARABOLA_STEP)) | (missing * missing * vv > S(THIRD_STEP * THIRD_STEP)) | uphill;
  return {select(uphill, a.from, next), j.px + step * (j.vx + step * j.ax), j.py + step * (j.vy + step * j.ay), cubic(c.z, next)};
}

// A step of Newton's, downhill, if it stays between the parameters last left in either direction, else to the middle of these. moved2: its
// squared length in px along the tangent.
template <class F> struct Bracket { F low, high; };
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
constexpr double ROUGH_STEP = .02;       // px: a last step of s px changes a distance d by s^2 / 2d at most, too little to tell two places apart (empirical)
constexpr int MORE_STEPS = 24;           // halvings of a piece: float32 has no digits left
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

template <class F, class S> HD F depth_at(const Piece<S> &c, F tau, F z) {
  return c.flat_w > S(0) ? z * c.flat_w : z / cubic(c.w, tau);
}

// The filter's integral F(x) and density F'(x), x in px.
template <class F, class S> HD F cumulative(const Filter<S> &f, F x) {
  if (f.inv_sigma == S(0)) return clamp(x + S(.5), S(0), S(1));
  // Abramowitz and Stegun 26.2.17, absolute error 7.5e-8.
  const F y = x * f.inv_sigma, m = greater(y, -y), k = S(1) / (S(1) + S(.2316419) * m);
  const F density = exponential(clamp(S(-.5) * m * m, S(-70), S(0))) * S(.3989422804014327);
  const F upper = density * k * (S(.319381530) + k * (S(-.356563782) + k * (S(1.781477937) + k * (S(-1.821255978) + k * S(1.330274429)))));
  const F phi = select(y > S(0), S(1) - upper, upper);
  return clamp((phi - S(BLUR_TAIL)) * S(1 / (1 - 2 * BLUR_TAIL)), S(0), S(1));
}
template <class F, class S> HD F density(const Filter<S> &f, F x) {
  if (f.inv_sigma == S(0)) return select((x > S(-.5)) & (x < S(.5)), x * S(0) + S(1), x * S(0));
  const F y = x * f.inv_sigma;
  const F d = exponential(clamp(S(-.5) * y * y, S(-70), S(0))) * (S(.3989422804014327 / (1 - 2 * BLUR_TAIL)) * f.inv_sigma);
  return select((y > S(-BLUR_REACH)) & (y < S(BLUR_REACH)), d, x * S(0));
}

// One fragment: a pixel d px from its closest point, which is at tau, z. r = half width in px there.
template <class F> struct Fragment { F depth, r, d, coverage; };
template <bool WORLD, class F, class S> HD Fragment<F> fragment(const Piece<S> &c, const Filter<S> &f, F tau, F z, F d) {
  Fragment<F> g;
  g.depth = depth_at(c, tau, z);
  g.r = WORLD ? c.half_width / g.depth : c.half_width + tau * S(0);
  g.d = d;
  g.coverage = cumulative(f, g.r - g.d);
  // Only a stroke thinner than the filter reaches leaves a pixel uncovered on its far side.
  if (WORLD || c.half_width < f.reach) g.coverage = g.coverage - cumulative(f, -g.r - g.d);
  return g;
}

// Sums over the fragments of one piece: the gradient with respect to the coefficients x, y, z, w, then to the half width, the opacity
// and the colour.
constexpr int NGRAD = 21;
template <class F> struct Moments { F x[4], y[4], z[4], w[4], half_width, opacity, rgb[3]; };

// Adds (hx, hy, hz, hw) tau^k to the coefficients.
template <bool W, class F> HD void add_value(Moments<F> &m, F tau, F hx, F hy, F hz, F hw) {
  for (int k = 0; k < 4; k++) {
    m.x[k] += hx, m.y[k] += hy, m.z[k] += hz;
    hx *= tau, hy *= tau, hz *= tau;
    if (W) m.w[k] += hw, hw *= tau;
  }
}
// Adds (hx, hy, hz) k tau^(k-1): the share of a derivative along the curve.
template <class F, class S> HD void add_slope(Moments<F> &m, F tau, F hx, F hy, F hz, S) {
  F power = tau * S(0) + S(1);
  for (int k = 1; k < 4; k++) {
    m.x[k] += S(k) * power * hx, m.y[k] += S(k) * power * hy, m.z[k] += S(k) * power * hz;
    power *= tau;
  }
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

// Adds g = dL/d(depth) of a hit: depth = z / w at tau, and tau moves.
template <class F, class S> HD void depth_adjoint(const Piece<S> &c, F tau, F qx, F qy, F g, Moments<F> &m, S one) {
  const Jet<F> j = jet(c, tau);
  F w1;
  const F iw = S(1) / cubic(c.w, tau, w1), depth = j.z * iw, zero = g * S(0);
  add_value<true>(m, tau, zero, zero, g * iw, -g * depth * iw);
  parameter_adjoint(j, tau, qx, qy, g * (j.z1 - depth * w1) * iw, m, one);
}

// Adds one fragment: ga = dL/d(alpha), gz = dL/d(depth of the hit) (DEPTH only). The distance needs no derivative of tau (eq. 5).
template <bool WORLD, bool DEPTH, class F, class S>
HD void fragment_adjoint(const Piece<S> &c, const Filter<S> &f, F tau, F qx, F qy, F ga, F gz, Moments<F> &m) {
  const Point<F> p = point_at(c, tau);
  const Fragment<F> g = fragment<WORLD>(c, f, tau, p.z, root(distance2(p, qx, qy)));
  m.opacity += g.coverage * ga;
  const F inner = density(f, g.r - g.d), gc = ga * c.opacity;
  F gr = gc * inner, gd = gr;
  if (WORLD || c.half_width < f.reach) {
    const F outer = gc * density(f, -g.r - g.d);
    gr += outer, gd = gd - outer;
  }
  const F k = gd / (greater(g.d, g.d * S(0) + S(1e-6)) * p.z);
  const F hx = k * (qx - p.x), hy = k * (qy - p.y), hz = -(hx * p.x + hy * p.y);
  add_value<false>(m, tau, hx, hy, hz, hz);
  m.half_width += WORLD ? gr / g.depth : gr;
  if (WORLD || DEPTH) depth_adjoint(c, tau, qx, qy, WORLD ? gz - gr * g.r / g.depth : gz, m, S(1));
}

// Adds g times the normal displacement of an outline point p + r u (eq. 12). along: length of outline per unit of tau (1 at caps), slope:
// dr/dtau (0 at caps and for constant width), both at the point.
template <bool WORLD, class S> HD void outline_adjoint(const Piece<S> &c, S tau, S ux, S uy, S along, S slope, S g, Moments<S> &m) {
  const Jet<S> j = jet(c, tau);
  const S iz = S(1) / j.z, speed = root(j.vx * j.vx + j.vy * j.vy);
  const S tilt = speed > S(0) ? slope / speed : S(0);
  S nx = along * ux - tilt * j.vx, ny = along * uy - tilt * j.vy;   // normal times length
  if (WORLD) {
    const S w = cubic(c.w, tau), depth = j.z / w, r = c.half_width / depth;
    // The unit normal u turns with the tangent.
    const S turn = r * tilt * iz * g;
    add_slope(m, tau, turn * ux, turn * uy, -turn * (ux * j.px + uy * j.py), S(1));
    nx -= r * tilt * j.z1 * iz * ux, ny -= r * tilt * j.z1 * iz * uy;
    const S gd = -g * along * r / depth;
    add_value<true>(m, tau, S(0), S(0), gd / w, -gd * depth / w);
    m.half_width += g * along / depth;
  } else {
    m.half_width += g * along;
  }
  const S hx = g * nx * iz, hy = g * ny * iz;
  add_value<false>(m, tau, hx, hy, -(hx * j.px + hy * j.py), S(0));
}

// A hash with good avalanche (the constants of Wellons' search "lowbias32"), and 24 of its bits as a number in [0, 1).
HD unsigned mix(unsigned h) {
  h ^= h >> 16, h *= 0x7feb352du;
  h ^= h >> 15, h *= 0x846ca68bu;
  return h ^ h >> 16;
}
HD float unit(unsigned h) { return float(h >> 8) * 5.9604644775390625e-8f; }

// From the sums of one piece to the gradient of its homogeneous control points, 4 x (X, Y, Z, W). in: NGRAD numbers in struct order.
template <class S> HD void control_gradient(const S *in, S ox, S oy, S *out) {
  for (int j = 0; j < 4; j++) {
    const S *m = in + 4 * j;
    // Each coefficient by its own name: from a loop over them GCC 12 looks them up in a table that it builds first.
    for (int i = 0; i < 4; i++) out[4 * i + j] = S(bern(i, 0)) * m[0] + S(bern(i, 1)) * m[1] + S(bern(i, 2)) * m[2] + S(bern(i, 3)) * m[3];
  }
  for (int i = 0; i < 4; i++) out[4 * i + 2] -= ox * out[4 * i] + oy * out[4 * i + 1];
}

}  // namespace stroke
