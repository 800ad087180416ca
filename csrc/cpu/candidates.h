// From the strokes of a tile to candidates: for every point within reach of a stroke the parameters from which its nearest point is looked for.
// Included by kernel.cpp only.
#pragma once
#include "cpu/tile.h"

namespace stroke {
namespace {
constexpr real LEVEL = 1e-6;  // slope of what is level: 1e-3 px over the length of a piece
// rows of points that may be reached
struct Rows {
  int lo, hi;
};
SIMD Rows join(Rows a, Rows b) { return {a.lo < b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi}; }

// Rows of points that chord c may reach.
template <int POINTS> SIMD Rows rows_of(const Place &p, const Chord<real> &c, real R) {
  if constexpr (POINTS == ANYWHERE) return {0, TILE - 1};
  const real oy = p.y + real(.5) - c.ay, reach = POINTS == GRID ? R : R + real(.5);
  return {int(clamp(min(real(0), c.ey) - reach - oy + 1, real(0), real(TILE))),
          int(clamp(max(real(0), c.ey) + reach - oy, real(-1), real(TILE - 1)))};
}
// Whether it may reach columns x .. x + VL - 1 of the tile.
template <int POINTS> SIMD bool in_columns(const Place &p, const Chord<real> &c, int x, real R) {
  const real ox = p.x + real(.5) - c.ax + x, reach = POINTS == GRID ? R : R + real(.5);
  return VPR == 1 || POINTS == ANYWHERE || !(ox > max(real(0), c.ex) + reach || ox + (VL - 1) < min(real(0), c.ex) - reach);
}
// The points from i on relative to a chord's start.
template <int POINTS> SIMD void from_start(const Place &p, const Work &k, const Chord<real> &c, int i, vf &dx, vf &dy) {
  if constexpr (POINTS == GRID) dx = to_real(iota()) + (p.x + real(.5) - c.ax + i % TILE), dy = splat(p.y + real(.5) - c.ay + i / TILE);
  else dx = load(k.x + i) + (p.x - c.ax), dy = load(k.y + i) + (p.y - c.ay);
}
// Their squared distances from the chord, and the parameters there.
template <int POINTS, int WIDTH>
SIMD vf chord_distance(const Place &p, const Work &k, const Piece<real> &piece, const Chord<real> &c, int i, vf &tau) {
  vf dx, dy, u;
  from_start<POINTS>(p, k, c, i, dx, dy);
  const vf d = chord_dist2<WIDTH>(piece, c, dx, dy, u);
  tau = chord_tau(c, u);
  return d;
}

// Visits the vectors of points that chord c may reach: f(first point).
template <int POINTS, class Visit> SIMD Rows visit_chord(const Place &p, const Chord<real> &c, real R, Visit f) {
  const Rows rows = rows_of<POINTS>(p, c, R);
  for (int x = 0; x < TILE; x += VL) {
    if (!in_columns<POINTS>(p, c, x, R)) continue;
    for (int y = rows.lo; y <= rows.hi; y++) f(y * TILE + x);
  }
  return rows;
}

// Nearest of the chords first .. last per point: k.d2 (R2 where out of reach), k.tau; and the nearest that is no neighbour of it, since the curve
// may come near a point twice: k.second, k.second_tau. Returns the rows reached.
template <int POINTS, int WIDTH> PHASE Rows nearest_two_chords(const Job<real> &J, uint32_t first, uint32_t last, const Place &p, Work &k, real R) {
  for (int i = 0; i < PIX; i += VL) store(k.d2 + i, splat(R * R)), store(k.second + i, splat(R * R));
  Rows rows = {TILE, -1};
  const Piece<real> &piece = J.pieces[J.chord_info[first].piece];
  for (uint32_t s = first; s <= last; s++) {
    const Chord<real> c = J.chords[s];
    // Of what is in front of the chord's neighbour. Nothing is in front of the first: parameters begin at -1/2.
    const vf neighbour = splat(s > first ? J.chords[s - 1].tau0 : real(-1));
    rows = join(rows, visit_chord<POINTS>(p, c, R, [&](int i) SIMD_LAMBDA {
                  vf tau;
                  const vf d = chord_distance<POINTS, WIDTH>(p, k, piece, c, i, tau), best = load(k.d2 + i), second = load(k.second + i),
                           best_tau = load(k.tau + i);
                  const vi nearer = d < best, apart = best_tau < neighbour;
                  // What comes second: this chord, or the one that it beats.
                  const vf rest = max(d, best), rest_tau = select(nearer, best_tau, tau);
                  const vi replaces = apart & (rest < second);
                  store(k.second + i, select(replaces, rest, second));
                  store(k.second_tau + i, select(replaces, rest_tau, load(k.second_tau + i)));
                  store(k.tau + i, select(nearer, tau, best_tau));
                  store(k.d2 + i, min(d, best));
                }));
  }
  return rows;
}

// Packs the points of these rows where in(i) holds behind fragment n: k.t from tau, k.px. Returns the new n.
template <class In> SIMD uint32_t pack(Work &k, Rows rows, const real *tau, uint32_t n, In in) {
  for (int i = rows.lo * TILE; i < (rows.hi + 1) * TILE; i += VL) {
    const Mask m = bits(in(i));
    compress_store(k.t + n, load(tau + i), m);
    compress_store(k.px + n, iota() + integer(i), m);
    n += count(m);
  }
  return n;
}

// Points of candidates, relative to (x, y).
template <int POINTS> SIMD void points_from(const Work &k, const Place &p, real x, real y, vi px, vf &qx, vf &qy) {
  if constexpr (POINTS == GRID) {
    qx = to_real(px & (TILE - 1)) + (p.x + real(.5) - x), qy = to_real(px / TILE) + (p.y + real(.5) - y);
  } else {
    for (int i = 0; i < VL; i++) qx[i] = k.x[px[i]], qy[i] = k.y[px[i]];
    qx += p.x - x, qy += p.y - y;
  }
}
template <int POINTS, int WIDTH> SIMD void points_of(const Work &k, const Place &p, const Piece<real> &c, vi px, vf &qx, vf &qy) {
  points_from<POINTS>(k, p, c.ox, c.oy, px, qx, qy);
  to_square<WIDTH>(c, qx, qy);
}

// Packs pixels behind fragment n: k.px, in every row from the first to the last with a point within reach of the chords first .. last, and some just
// beyond. Looks at all rows at once, a lane each. Returns the new n.
template <int POINTS> PHASE uint32_t pack_rows(const Job<real> &J, uint32_t first, uint32_t last, const Place &p, Work &k, uint32_t n, real R) {
  static_assert(POINTS != ANYWHERE);
  // What is within reach of a chord lies in the box around both ends and in the band on both sides. A point lies up to half a pixel from the
  // middle of its pixel in either direction, up to half a diagonal across the band.
  const real box = POINTS == GRID ? R : R + real(.5), band = POINTS == GRID ? R : R + real(.7072);
  vf low[VPR], high[VPR];
  for (int v = 0; v < VPR; v++) low[v] = splat(TILE), high[v] = splat(-1);
  for (uint32_t s = first; s <= last; s++) {
    const Chord<real> &c = J.chords[s];
    const real x = c.ax - p.x - real(.5), y = c.ay - p.y - real(.5);
    // Level chords pass for nearly level ones, and points for upright ones.
    const real rise = max(max(c.ey, -c.ey), LEVEL * max(c.ex, -c.ex) + real(1e-15)), inverse = 1 / rise;
    const real slope = (c.ey < 0 ? -c.ex : c.ex) * inverse, across = band * sqrt(c.ex * c.ex + rise * rise) * inverse;
    const real left = min(real(0), c.ex) + x - box, right = max(real(0), c.ex) + x + box;
    const real top = min(real(0), c.ey) + y - box, bottom = max(real(0), c.ey) + y + box;
    for (int v = 0; v < VPR; v++) {
      const vf row = to_real(iota() + integer(v * VL)), middle = (row - y) * slope + x;
      const vi in = (row >= top) & (row <= bottom);
      low[v] = select(in, min(low[v], max(middle - across, splat(left))), low[v]);
      high[v] = select(in, max(high[v], min(middle + across, splat(right))), high[v]);
    }
  }
  alignas(64) integer begin[TILE], pixels[TILE];
  for (int v = 0; v < VPR; v++) {
    const vf l = max(low[v], vf{}), h = min(high[v], splat(TILE - 1));
    const vi whole = __builtin_convertvector(l, vi), start = whole - (to_real(whole) < l);  // rounded up
    const vi number = __builtin_convertvector(max(h + real(1), vf{}), vi) - start;
    store(begin + v * VL, start + (iota() + integer(v * VL)) * TILE), store(pixels + v * VL, number > 0 ? number : vi{});
  }
  integer *px = k.px + n;
  for (int y = 0; y < TILE; y++) {
    for (int x = 0; x < TILE; x += VL)
      if (x == 0 || x < pixels[y]) store(px + x, iota() + integer(begin[y] + x));
    px += pixels[y];
  }
  return uint32_t(px - k.px);
}

// The starts of candidates [n0, n) of a smooth run: k.t, the parameter behind the fractions of all its chords that the points have passed. Near a joint
// the fractions of both chords change it, where the nearest chord's would jump (eq. 14).
template <int POINTS> PHASE void start_along(const Job<real> &J, uint32_t first, uint32_t last, const Place &p, Work &k, uint32_t n0, uint32_t n) {
  const Chord<real> *begin = J.chords + first, *end = J.chords + last + 1;
  const real x = begin->ax, y = begin->ay;
  for (uint32_t i = n0; i < n; i += VL) {
    vf dx, dy, tau = splat(begin->tau0);
    points_from<POINTS>(k, p, x, y, load(k.px + i) & (PIX - 1), dx, dy);
    for (const Chord<real> *c = begin; c != end; c++) {
      const vf u = clamp((dx - (c->ax - x)) * c->ix + (dy - (c->ay - y)) * c->iy, real(0), real(1));
      tau += u * ((c->dtau + c->bow) - u * c->bow);
    }
    store(k.t + i, tau);
  }
}

// From a start on a chord to the nearest point, roughly, and its squared distance.
struct Settled {
  vf tau, d2;
};
SIMD Settled settle(const Piece<real> &c, vf start, vf qx, vf qy, vi in) {
  const Point<vf> point = arrive(c, newton_step(c, start, qx, qy), qx, qy, in, real(ROUGH_STEP));
  return {point.tau, distance2(point, qx, qy)};
}
SIMD vi lanes_before(uint32_t i, uint32_t n) { return iota() < splat_int(integer(n - i)); }

// The nearest points of candidates [n0, n) of one piece; the best so far of each pixel is kept in k.best (squared distance), best_tau, best_piece.
template <int POINTS, int WIDTH> SIMD void improve(const Job<real> &J, uint32_t piece, const Place &p, Work &k, uint32_t n0, uint32_t n) {
  const Piece<real> c = J.pieces[piece];
  for (uint32_t i = n0; i < n; i += VL) {
    const vi px = load(k.px + i) & (PIX - 1);
    vf qx, qy;
    points_of<POINTS, WIDTH>(k, p, c, px, qx, qy);
    const Settled s = settle(c, load(k.t + i), qx, qy, lanes_before(i, n));
    const int lanes = int(n - i) < VL ? int(n - i) : VL;
    for (int j = 0; j < lanes; j++) {
      const int q = int(px[j]);
      if (s.d2[j] < k.best[q]) k.best[q] = s.d2[j], k.best_tau[q] = s.tau[j], k.best_piece[q] = integer(piece);
    }
  }
}

// Decides between k.tau, from the nearest chord, and other starts, the candidates [n0, n) of one piece: the one that leads nearer goes to k.tau.
// Half of a vector's lanes begin at the one, half at the others: contested points are few.
template <int POINTS, int WIDTH> SIMD void decide(const Job<real> &J, uint32_t piece, const Place &p, Work &k, uint32_t n0, uint32_t n) {
  constexpr int HALF = VL / 2;
  const Piece<real> c = J.pieces[piece];
  for (uint32_t i = n0; i < n; i += HALF) {
    const int lanes = int(n - i) < HALF ? int(n - i) : HALF;
    vi px = load(k.px + i) & (PIX - 1);
    vf start = load(k.t + i), qx, qy;
    for (int j = 0; j < HALF; j++) px[HALF + j] = px[j], start[HALF + j] = k.tau[px[j]];
    points_of<POINTS, WIDTH>(k, p, c, px, qx, qy);
    const Settled s = settle(c, start, qx, qy, (iota() & (HALF - 1)) < splat_int(lanes));
    for (int j = HALF; j < HALF + lanes; j++) k.tau[px[j]] = s.tau[j], k.best[px[j]] = s.d2[j];
    for (int j = 0; j < lanes; j++)  // a point may be here twice
      if (s.d2[j] < k.best[px[j]]) k.tau[px[j]] = s.tau[j], k.best[px[j]] = s.d2[j];
  }
}

// Closes the candidates [n0, n1) of a piece: a layer of their own, with the rest of the last vector marked empty. Returns where the next begin.
SIMD uint32_t add_layer(Work &k, uint32_t piece, uint32_t slot, uint32_t n0, uint32_t n1) {
  if (n0 == n1) return n0;
  store(k.px + n1, splat_int(-1)), store(k.t + n1, vf{});
  reserve_layers(k, k.layers + 1);
  k.layer[k.layers] = {piece, slot, 0, 0};
  for (uint32_t v = n0 / VL; v * VL < n1; v++) k.owner[v] = k.layers;
  k.layers++;
  return (n1 + VL - 1) / VL * VL;
}

// Candidates behind n of the rows' points where the second chord of nearest_two_chords may lead to the nearest point too.
SIMD uint32_t pack_second(const Job<real> &J, Work &k, Rows rows, uint32_t n, real R) {
  for (int i = rows.lo * TILE; i < (rows.hi + 1) * TILE; i += VL) {
    const vf second = load(k.second + i);
    const vi within = second < R * R;
    if (!any(within)) continue;  // nearly always
    const vf limit = sqrt(load(k.d2 + i)) + J.chord_slack;
    const Mask m = bits(within & (second < limit * limit));
    compress_store(k.t + n, load(k.second_tau + i), m), compress_store(k.px + n, iota() + integer(i), m);
    n += count(m);
  }
  return n;
}

// The same where an end of the piece, at this chord, may be the nearest point of a bend; where it is what nearest_two_chords found, from the
// middle of the chord. Neither is so where the point lies farther to one side of the end than the chord turns.
template <int POINTS, int WIDTH> SIMD uint32_t pack_end(const Job<real> &J, uint32_t chord, bool stop, const Place &p, Work &k, uint32_t n, real R) {
  const Chord<real> c = J.chords[chord];
  const ChordInfo &info = J.chord_info[chord];
  const Piece<real> &piece = J.pieces[info.piece];
  if (info.turn * float(R) < BENT_END * info.length) return n;
  const real end = stop ? real(.5) : real(-.5), x = stop ? c.ex : real(0), y = stop ? c.ey : real(0), middle = chord_tau(c, real(.5));
  real ahead_x = c.ex, ahead_y = c.ey;
  to_square<WIDTH>(piece, ahead_x, ahead_y);
  const real inwards = stop ? real(-1) : real(1), turn = real(info.turn) * info.length;
  visit_chord<POINTS>(p, c, R, [&](int i) SIMD_LAMBDA {
    vf dx, dy;
    from_start<POINTS>(p, k, c, i, dx, dy);
    vf ex = dx - x, ey = dy - y;
    to_square<WIDTH>(piece, ex, ey);
    const vf d2 = ex * ex + ey * ey, along = (ex * ahead_x + ey * ahead_y) * inwards;
    const vf limit = sqrt(load(k.d2 + i)) + J.chord_slack;
    const vi found = load(k.tau + i) == splat(end);
    const Mask m = bits((d2 < limit * limit) & (d2 < R * R) & (select(found, -along, along) < turn * sqrt(d2)));
    compress_store(k.t + n, select(found, splat(middle), splat(end)), m);
    compress_store(k.px + n, iota() + integer(i), m);
    n += count(m);
  });
  return n;
}

// Candidates behind n besides the nearest of the chords first .. last of a piece. Returns the new n.
template <int POINTS, int WIDTH>
SIMD uint32_t other_candidates(const Job<real> &J, uint32_t first, uint32_t last, const Place &p, Work &k, Rows rows, uint32_t n, real R) {
  n = pack_second(J, k, rows, n, R);
  if (J.chords[first].tau0 == real(-.5)) n = pack_end<POINTS, WIDTH>(J, first, false, p, k, n, R);
  if (J.chords[last].tau0 + J.chords[last].dtau == real(.5)) n = pack_end<POINTS, WIDTH>(J, last, true, p, k, n, R);
  return n;
}

// Candidates of a stroke with bends or cusps over the tile, but a single piece.
template <int POINTS, int WIDTH>
PHASE uint32_t bent_candidates(const Job<real> &J, const Intersection &e, const Place &p, Work &k, uint32_t n0, real R) {
  const Rows rows = nearest_two_chords<POINTS, WIDTH>(J, e.first, e.last, p, k, R);
  decide<POINTS, WIDTH>(J, e.piece, p, k, n0, other_candidates<POINTS, WIDTH>(J, e.first, e.last, p, k, rows, n0, R));
  return add_layer(k, e.piece, e.slot, n0, pack(k, rows, k.tau, n0, [&](int i) SIMD_LAMBDA { return load(k.d2 + i) < R * R; }));
}

// Candidates of a stroke with several pieces over the tile, those of intersections begin .. end: the best of all pieces.
template <int POINTS, int WIDTH>
PHASE uint32_t candidates_of_pieces(const Job<real> &J, const Intersection *begin, const Intersection *end, const Place &p, Work &k, uint32_t n0,
                                    real R) {
  for (int i = 0; i < PIX; i += VL) store(k.best + i, splat(real(1e30)));
  Rows all = {TILE, -1};
  for (const Intersection *e = begin; e != end; e++)
    for (uint32_t first = e->first, last; first <= e->last; first = last + 1) {
      const uint32_t piece = J.chord_info[first].piece;
      for (last = first; last < e->last && J.chord_info[last + 1].piece == piece;) last++;
      const Rows rows = nearest_two_chords<POINTS, WIDTH>(J, first, last, p, k, R);
      const uint32_t n = pack(k, rows, k.tau, n0, [&](int i) SIMD_LAMBDA { return load(k.d2 + i) < R * R; });
      improve<POINTS, WIDTH>(J, piece, p, k, n0, other_candidates<POINTS, WIDTH>(J, first, last, p, k, rows, n, R));
      all = join(all, rows);
    }
  for (const Intersection *e = begin; e != end; e++)
    for (uint32_t piece = e->piece; piece < e->piece + e->pieces; piece++) {
      reserve(k, n0, n0 + PIX);
      const uint32_t n1 = pack(k, all, k.best_tau, n0, [&](int i) SIMD_LAMBDA {
        return (load(k.best + i) < real(1e30)) & (load(k.best_piece + i) == splat_int(integer(piece)));
      });
      n0 = add_layer(k, piece, e->slot + (piece - e->piece), n0, n1);
    }
  return n0;
}
}  // namespace
}  // namespace stroke
