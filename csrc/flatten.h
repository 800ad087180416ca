// Strokes to pieces and chords on the CPU, in double precision: the walk; the rules are in flatten_math.h.
#pragma once
#include "flatten_math.h"
#include "memory.h"

namespace stroke {

template <class S> struct Flat {
  List<Piece<S>> pieces;
  List<PieceInfo> piece_info;
  List<Chord<S>> chords;
  List<ChordInfo> chord_info;
  List<Tangents> tangents;             // of every chord; Monte Carlo only
};

class Flattener {
  Control whole_;
  double reach_;
  Frame frame_;
  bool outline_;
  double span_start_ = 0, span_stop_ = 1;
  uint32_t stroke_ = 0;
  float bend_ = 0;
  Direction last_tangent_ = {};
  bool gap_ = true, partly_outside_ = true;
  int sure_depth_ = 0, cuts_ = 0;

  static void split(const Control &k, double t, Control &a, Control &b) {
    auto lerp = [t](v4d p, v4d q) { return p + (q - p) * t; };
    const v4d p01 = lerp(k.c[0], k.c[1]), p12 = lerp(k.c[1], k.c[2]), p23 = lerp(k.c[2], k.c[3]);
    const v4d p012 = lerp(p01, p12), p123 = lerp(p12, p23), middle = lerp(p012, p123);
    a = {k.c[0], p01, p012, middle}, b = {middle, p123, p23, k.c[3]};
  }
  static void halve(v4f a, v4f &left, v4f &right) {
    const v4f p = (a + v4f{a[1], a[2], a[3], a[3]}) * .5f, q = (p + v4f{p[1], p[2], p[3], p[3]}) * .5f, r = (q + v4f{q[1], q[1], q[1], q[1]}) * .5f;
    left = v4f{a[0], p[0], q[0], r[0]}, right = v4f{r[0], q[1], p[2], a[3]};
  }

  template <class S> void add_chord(Flat<S> &out, const Arc &k, const Ends &e, float t0, float dt) {
    const uint32_t piece = uint32_t(out.pieces.size() - 1);
    bend_ += gap_ ? SHARP : turning(last_tangent_, e.a);
    const float before = bend_;
    bend_ += e.turn * reach_ > TIGHT * e.length ? SHARP : e.turn;
    out.chords.add(make_chord(out.pieces[piece], k, t0, dt));
    out.chord_info.add({piece, before, bend_, e.length, e.turn});
    if (outline_) out.tangents.add({e.a.x, e.a.y, e.b.x, e.b.y});
    last_tangent_ = e.b, gap_ = false;
  }

  template <class S> void chords(Flat<S> &out, const Arc &k, float t0, float dt, int depth) {
    if (partly_outside_ && frame_.outside(k, out.pieces[out.pieces.size() - 1])) {
      gap_ = true;
      return;
    }
    float across;
    if (depth >= sure_depth_ && (flat(k, across) || depth == MAX_CHORD_DEPTH)) {
      const Ends e = ends_of(k);
      if (gentle(e, across, reach_, outline_) || depth == MAX_CHORD_DEPTH) return add_chord(out, k, e, t0, dt);
    }
    Arc a, b;
    halve(k.x, a.x, b.x), halve(k.y, a.y, b.y), halve(k.z, a.z, b.z);
    project(a), project(b);
    chords(out, a, t0, dt / 2, depth + 1), chords(out, b, t0 + dt / 2, dt / 2, depth + 1);
  }

  template <class S> void add_piece(Flat<S> &out, const Control &k, const v4d *p, double start, double stop, const Piece<S> &look) {
    Piece<S> c = look;
    const Arc arc = make_piece(k, p, c);
    PieceInfo info{};
    info.stroke = stroke_, info.start = start, info.stop = stop;
    info.first_chord = uint32_t(out.chords.size());
    info.cap_start = start == span_start_, info.cap_stop = stop == span_stop_;
    blossom(start, stop, info.map);
    out.pieces.add(c);
    out.piece_info.add(info);
    bend_ += SHARP;
    partly_outside_ = !frame_.inside(p);
    sure_depth_ = sure_depth(arc);
    chords(out, arc, 0, 1, 0);
    if (out.chords.size() == info.first_chord) {
      out.pieces.shorten(out.pieces.size() - 1), out.piece_info.shorten(out.piece_info.size() - 1);
      return;
    }
    out.piece_info[out.piece_info.size() - 1].end_chord = uint32_t(out.chords.size());
  }

  // Cuts a visible span until its parts are tame, dropping those off the image.
  template <class S> void pieces(Flat<S> &out, const Control &k, double start, double stop, int depth, const Piece<S> &look) {
    if (positive(k)) {
      v4d p[4];
      for (int i = 0; i < 4; i++) p[i] = on_screen(k.c[i]);
      if (frame_.outside(p)) {
        gap_ = true;
        return;
      }
      if (depth == MAX_DEPTH || tame(k, p)) return add_piece(out, k, p, start, stop, look);
    } else if (depth == MAX_DEPTH || high(k.c, 2) <= 0) {
      gap_ = true;  // behind the camera: only rounding can bring such a part of a visible span about
      return;
    }
    if (++cuts_ > MAX_CUTS) {
      gap_ = true;
      return;
    }
    const double t = cut_at(k), middle = start + (stop - start) * t;
    Control a, b;
    split(k, t, a, b);
    pieces(out, a, start, middle, depth + 1, look), pieces(out, b, middle, stop, depth + 1, look);
  }

  template <class S> void span(Flat<S> &out, double a, double b, const Piece<S> &look) {
    span_start_ = a, span_stop_ = b, gap_ = true;
    double map[16];
    blossom(a, b, map);
    pieces(out, a == 0 && b == 1 ? whole_ : mapped(whole_, map), a, b, 0, look);
  }

public:
  // Visible spans: where margin = Z - near W, a cubic, is positive. Halves intervals until the coefficients agree on a sign; f(a, b) in order.
  template <class Visit> static void visible_spans(const double *margin, Visit f) {
    double open = -1, end = -1;
    auto visit = [&](auto &self, const double *g, double a, double b, int depth) -> void {
      const bool up = g[0] > 0 && g[1] > 0 && g[2] > 0 && g[3] > 0, down = g[0] <= 0 && g[1] <= 0 && g[2] <= 0 && g[3] <= 0;
      if (up) {
        if (open < 0) open = a;
        end = b;
        return;
      }
      if (down || depth == MAX_DEPTH) {
        if (open >= 0) f(open, end);
        open = -1;
        return;
      }
      const double p01 = (g[0] + g[1]) / 2, p12 = (g[1] + g[2]) / 2, p23 = (g[2] + g[3]) / 2, p = (p01 + p12) / 2, q = (p12 + p23) / 2;
      const double m = (p + q) / 2, l[4] = {g[0], p01, p, m}, r[4] = {m, q, p23, g[3]};
      self(self, l, a, (a + b) / 2, depth + 1), self(self, r, (a + b) / 2, b, depth + 1);
    };
    visit(visit, margin, 0, 1, 0);
    if (open >= 0) f(open, end);
  }

  // outline: chords turn little, as the Monte Carlo boundary samples need.
  Flattener(int height, int width, bool outline) : reach_(0), frame_{0, double(width), 0, double(height)}, outline_(outline) {}

  // Adds one stroke: cubic 4 x (X, Y, Z, W), normalised so that the largest W is 1. reach: px beyond which nothing is covered.
  template <class S> void add(Flat<S> &out, const double *cubic, double near, double reach, uint32_t stroke, const Piece<S> &look) {
    double margin[4];
    for (int i = 0; i < 4; i++) {
      whole_.c[i] = v4d{cubic[4 * i], cubic[4 * i + 1], cubic[4 * i + 2], cubic[4 * i + 3]};
      margin[i] = whole_.c[i][2] - near * whole_.c[i][3];
    }
    const double old = reach_;
    frame_.left -= reach - old, frame_.top -= reach - old, frame_.right += reach - old, frame_.bottom += reach - old;
    reach_ = reach, stroke_ = stroke, bend_ = 0, cuts_ = 0, gap_ = true;
    visible_spans(margin, [&](double a, double b) { span(out, a, b, look); });
  }
};
}  // namespace stroke
