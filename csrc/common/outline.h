// Points on the outlines of strokes, spent in proportion to their length (Monte Carlo; docs/explanation/mathematics.md, eq. 11), for every driver.
#pragma once
#include "common/flatten.h"
#include "common/hash.h"

namespace stroke {
// px: two strokes whose outlines touch within this count as overlapping there.
constexpr double OUTLINE_SLACK = 1e-3;
// px: a point this much farther from the nearest point of its stroke than the half width there is no outline either: it belongs to a wider part that
// lies farther away. Where widths change, parameters that are off by TANGENT_STEP change them.
constexpr double OUTLINE_GAP = 1e-2;
// A joint that turns by less (radians) is smooth but for rounding: both sides go on across it.
constexpr float JOINT_TURN = 1e-3f;
// One point on the outline of a piece, at o + p(tau) + r u; along, slope: see outline_adjoint. It stands for along * dtau px.
template <class S> struct OutlinePoint {
  S x, y, ux, uy, tau, along, slope, dtau;
  uint32_t piece;
};

// The outline of a piece: both sides of every chord, a half circle at each visible end of the stroke, and an arc wherever the normal jumps.
// Points on it that lie inside the stroke are sorted out later. Flat: pieces, piece_info, chords, chord_info (length, turn) and tangents, by index.
template <class S, class Flat> class OutlineSampler {
  static constexpr double PI = 3.14159265358979323846;
  const Flat &flat_;
  bool world_, along_;
  int density_;  // points per px of outline
  uint64_t seed_;
  uint32_t first_, step_;  // of the points of each part this caller makes: number first, first + step, ..

  HD double half_width(const Piece<S> &c, double tau) const {
    const double value = along_ ? double(cubic(c.half_width, S(tau))) : double(c.half_width[0]);
    return world_ ? value / depth_at(c, S(tau), cubic(c.z, S(tau))) : value;
  }
  HD float random(uint32_t piece, uint32_t arc, uint32_t i) const {
    const PieceInfo &info = flat_.piece_info[piece];
    const uint32_t place = mix(info.segment ^ mix(uint32_t(info.start * 4294967295.0) ^ mix(arc)));
    return unit(mix(uint32_t(seed_) ^ mix(uint32_t(seed_ >> 32) ^ mix(place ^ mix(i)))));
  }
  HD static uint32_t count(double length, int density) { return length > 0 ? uint32_t(ceil(least(length, 1e7) * density)) : 0; }
  // The point r u from (px, py) that stands for dtau; its place and its share of the area are in pixels.
  HD static OutlinePoint<S> point(const Piece<S> &c, S px, S py, double r, double ux, double uy, double tau, double along, S slope, double dtau,
                                  uint32_t piece) {
    OutlinePoint<S> o = {S(c.ox + px + r * ux), S(c.oy + py + r * uy), S(ux), S(uy), S(tau), S(along), slope, S(dtau), piece};
    if (!c.oblong) return o;
    double x = px + r * ux, y = py + r * uy;
    square_of(c).inverse().map(x, y);
    o.x = S(c.ox + x), o.y = S(c.oy + y), o.dtau = S(dtau / square_of(c).area());
    return o;
  }
  // A chord that is but a jump of the tangent has no sides.
  HD bool jump(uint32_t chord) const { return flat_.chord_info[chord].turn > OUTLINE_TURN; }
  HD double measure(const Piece<S> &c, uint32_t chord) const {
    const Chord<S> &k = flat_.chords[chord];
    const double r = most(half_width(c, k.tau0), half_width(c, double(k.tau0) + k.dtau));
    return jump(chord) ? 0 : flat_.chord_info[chord].length + flat_.chord_info[chord].turn * r;
  }

  // Points of a circle around the piece at tau, from `angle` on; as all parts, it returns how many there may be.
  template <class Put> HD uint32_t circle(uint32_t piece, double tau, double angle, double extent, uint32_t arc, uint32_t slot, Put put) const {
    const Piece<S> &c = flat_.pieces[piece];
    const double r = half_width(c, tau);
    const uint32_t n = most(4u, count(r * extent, density_));
    const Jet<S> j = jet(c, S(tau));
    for (uint32_t i = first_; i < n && r > 0; i += step_) {
      const double a = angle + extent * (i + double(random(piece, arc, i))) / n, ux = cos(a), uy = sin(a);
      put(slot + i, point(c, j.px, j.py, r, ux, uy, tau, 1, 0, r * extent / n, piece));
    }
    return n;
  }
  // Where the tangent jumps from (ax, ay) to (bx, by): the arc on the outside of the turn, if that is at least so large.
  template <class Put>
  HD uint32_t turn_arc(uint32_t piece, double tau, float ax, float ay, float bx, float by, float least, uint32_t arc, uint32_t slot, Put put) const {
    const double turn = atan2(ax * by - ay * bx, ax * bx + ay * by), from = atan2(ay, ax);
    if (!(abs(turn) > least)) return 0;
    return circle(piece, tau, turn > 0 ? from - PI / 2 : from + PI / 2 + turn, abs(turn), arc, slot, put);
  }

  template <class Put> HD uint32_t side(uint32_t piece, double sign, uint32_t arc, double total, uint32_t slot, Put put) const {
    const Piece<S> &c = flat_.pieces[piece];
    const PieceInfo &info = flat_.piece_info[piece];
    const uint32_t n = count(total, density_);
    uint32_t chord = info.first_chord;
    double before = 0, here = measure(c, chord);
    for (uint32_t i = first_; i < n; i += step_) {
      const double at = (i + double(random(piece, arc, i))) / n * total;
      while (at >= before + here && chord + 1 < info.end_chord) before += here, here = measure(c, ++chord);
      if (jump(chord)) continue;
      const Chord<S> &k = flat_.chords[chord];
      const double tau = k.tau0 + clamp((at - before) / here, 0., 1.) * k.dtau;
      const Jet<S> j = jet(c, S(tau));
      const double speed = sqrt(double(j.vx) * j.vx + double(j.vy) * j.vy);
      if (!(speed > 0)) continue;
      const double ux = -sign * j.vy / speed, uy = sign * j.vx / speed, r = half_width(c, tau);
      // |q'| = |v| (1 - r (u . a) / |v|^2), negative on the inside of bends tighter than r, which is no outline.
      const double along = speed - 2 * r * (ux * j.ax + uy * j.ay) / speed;  // j.ax: half the second derivative
      if (!(along > 0) || !(r > 0)) continue;
      S slope = 0;
      if (world_) {
        S w1;
        const S w = cubic(c.w, S(tau), w1), depth = j.z / w;
        slope = S(-r * (j.z1 - depth * w1) / (w * depth));
      }
      if (along_) {
        S change;
        cubic(c.half_width, S(tau), change);
        slope += world_ ? change / depth_at(c, S(tau), j.z) : change;
      }
      put(slot + i, point(c, j.px, j.py, r, ux, uy, tau, along, slope, k.dtau / here * total / n, piece));
    }
    return n;
  }

public:
  // The caller makes the points first, first + step, .. of every part; first = -1 makes none.
  HD OutlineSampler(const Flat &flat, bool world, bool along, int density, uint64_t seed, uint32_t first = 0, uint32_t step = 1)
      : flat_(flat), world_(world), along_(along), density_(density), seed_(seed), first_(first), step_(step) {}

  // put(slot, OutlinePoint) for every point of a piece, always in the same order; returns the number of slots. Some may stay empty.
  template <class Put> HD uint32_t piece(uint32_t piece, Put put) const {
    const Piece<S> &c = flat_.pieces[piece];
    const PieceInfo &info = flat_.piece_info[piece];
    if (info.first_chord == info.end_chord) return 0;
    double total = 0, length = 0;
    for (uint32_t s = info.first_chord; s < info.end_chord; s++) total += measure(c, s), length += flat_.chord_info[s].length;
    if (length < 1e-6 && info.cap_start && info.cap_stop) return circle(piece, -.5, 0, 2 * PI, 0, 0, put);  // a dot
    uint32_t n = 0;
    if (total > 0) n += side(piece, 1, 0, total, n, put), n += side(piece, -1, 1, total, n, put);
    const auto *tangents = &flat_.tangents[0];
    const Tangents &start = tangents[info.first_chord], &stop = tangents[info.end_chord - 1];
    if (info.cap_start) n += circle(piece, -.5, atan2(start.ay, start.ax) + PI / 2, PI, 2, n, put);
    if (info.cap_stop) n += circle(piece, .5, atan2(stop.by, stop.bx) - PI / 2, PI, 3, n, put);
    // The chord in front of the first one: of the piece before it, which may lie behind in the list where a stroke closes.
    const uint32_t front = info.before == NO_PIECE ? 0 : flat_.piece_info[info.before].end_chord;
    for (uint32_t s = info.first_chord; s < info.end_chord; s++) {
      const Chord<S> &k = flat_.chords[s];
      const Tangents &t = tangents[s];
      const uint32_t arc = 4 + 2 * (s - info.first_chord);
      if (jump(s)) n += turn_arc(piece, k.tau0 + .5 * k.dtau, t.ax, t.ay, t.bx, t.by, OUTLINE_TURN, arc, n, put);
      // Where a chord is left out before this one, that is far from the image.
      const uint32_t end = s > info.first_chord ? s : front;
      const float least = s == info.first_chord && info.start == 0 ? JOINT_TURN : OUTLINE_TURN;
      if (end) n += turn_arc(piece, k.tau0, tangents[end - 1].bx, tangents[end - 1].by, t.ax, t.ay, least, arc + 1, n, put);
    }
    return n;
  }
};
}  // namespace stroke
