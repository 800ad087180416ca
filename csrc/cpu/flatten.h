// Strokes to pieces (in double precision) and chords (four at a time) on the CPU: the walk; the rules are in common/flatten.h.
#pragma once
#include "common/flatten.h"
#include "cpu/memory.h"
#include <cstring>

namespace stroke {
typedef float v4f __attribute__((vector_size(16)));
typedef int v4i __attribute__((vector_size(16)));

template <class S> struct Flat {
  List<Piece<S>> pieces;
  List<PieceInfo> piece_info;
  List<Chord<S>> chords;
  List<ChordInfo> chord_info;
  List<Tangents> tangents;  // of every chord; Monte Carlo only
};

// The power -2/3 of x, from 1e-30 to 1e30, within 6 %: the bits of a float are about the logarithm of its value.
inline float about_power(float x) {
  constexpr int ONE = 0x3f800000;
  int bits;
  std::memcpy(&bits, &x, sizeof bits);
  bits = ONE - (bits - ONE) / 3 * 2;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}
// Square of the parameter step within which the parabola that touches a piece stands for it. low: the least z.
constexpr float PARABOLA_ERROR = 1e-5f;  // px
template <class S> float parabola_step2(const Piece<S> &c, float low) {
  const float scale = 1 / low;
  float x[4], y[4], z[4];
  // Bounds over the piece of a polynomial over `low`, and of its k-th derivatives over k!.
  auto bound = [scale](const S *a, float *out) {
    float b[4];
    for (int k = 0; k < 4; k++) b[k] = abs(float(a[k])) * scale;
    out[0] = (b[0] + .5f * b[1]) + (.25f * b[2] + .125f * b[3]), out[1] = b[1] + (b[2] + .75f * b[3]), out[2] = b[2] + 1.5f * b[3], out[3] = b[3];
  };
  bound(c.x, x), bound(c.y, y), bound(c.z, z);
  // Those of v = (x + y) / z follow in turn, from v z = x + y. The third derivative is what the parabola lacks.
  const float v0 = x[0] + y[0], v1 = (x[1] + y[1]) + v0 * z[1], v2 = (x[2] + y[2] + v0 * z[2]) + v1 * z[1];
  const float v3 = (x[3] + y[3] + v0 * z[3]) + v1 * z[2] + v2 * z[1];
  return about_power(least(v3 / PARABOLA_ERROR + 1e-30f, 1e30f));
}

// A segment of a stroke: its number among those of all views, that of its stroke, and whether it goes on from another one, or another one from it.
// widths: half widths at its control points, or null where the stroke has one width.
struct Segment {
  uint32_t stroke, index;
  bool joined_start, joined_stop;
  const double *widths;
};

class Flattener {
  Control whole_;
  double reach_;
  Frame frame_;
  float left_ = 0, right_ = 0, top_ = 0, bottom_ = 0;  // the frame relative to the piece's origin
  bool outline_;
  double span_start_ = 0, span_stop_ = 1;
  Segment segment_ = {};
  float bend_ = 0;
  Direction<float> last_tangent_ = {};
  bool gap_ = true, partly_outside_ = true;
  int sure_depth_ = 0, cuts_ = 0;

  static void split(const Control &k, double t, Control &a, Control &b) {
    auto lerp = [t](v4d p, v4d q) { return p + (q - p) * t; };
    const v4d p01 = lerp(k.c[0], k.c[1]), p12 = lerp(k.c[1], k.c[2]), p23 = lerp(k.c[2], k.c[3]);
    const v4d p012 = lerp(p01, p12), p123 = lerp(p12, p23), middle = lerp(p012, p123);
    a = {k.c[0], p01, p012, middle}, b = {middle, p123, p23, k.c[3]};
  }
  // Halves four arcs: those of lanes 0 and 1 one after the other, and those of lanes 2 and 3.
  static void halve(const v4f *a, v4f *first, v4f *last) {
    const v4f p0 = (a[0] + a[1]) * .5f, p1 = (a[1] + a[2]) * .5f, p2 = (a[2] + a[3]) * .5f;
    const v4f q0 = (p0 + p1) * .5f, q1 = (p1 + p2) * .5f, middle = (q0 + q1) * .5f;
    const v4f left[4] = {a[0], p0, q0, middle}, right[4] = {middle, q1, p2, a[3]};
    for (int i = 0; i < 4; i++) {
      const v4f l = left[i], r = right[i];
      first[i] = v4f{l[0], r[0], l[1], r[1]}, last[i] = v4f{l[2], r[2], l[3], r[3]};
    }
  }
  template <class S> void add_chord(Flat<S> &out, const Chord<float> &chord, const Ends<float> &e) {
    const uint32_t piece = uint32_t(out.pieces.size() - 1);
    bend_ += gap_ ? SHARP : turning(last_tangent_, e.a);
    const float before = bend_;
    bend_ += e.turn * reach_ > TIGHT * e.length ? SHARP : e.turn;
    out.chords.add(placed(chord, out.pieces[piece]));
    out.chord_info.add({piece, before, bend_, e.length, e.turn});
    if (outline_) out.tangents.add({e.a.x, e.a.y, e.b.x, e.b.y});
    last_tangent_ = e.b, gap_ = false;
  }

  v4i outside(const Arc<v4f> &k) const {  // as Frame: NaN counts as a miss
    const v4f x0 = least(k.u[0], k.u[1], k.u[2], k.u[3]), x1 = most(k.u[0], k.u[1], k.u[2], k.u[3]);
    const v4f y0 = least(k.v[0], k.v[1], k.v[2], k.v[3]), y1 = most(k.v[0], k.v[1], k.v[2], k.v[3]);
    return ~((x1 >= left_) & (x0 <= right_) & (y1 >= top_) & (y0 <= bottom_));
  }
  static Chord<float> lane(const Chord<v4f> &c, int i) {
    return {c.ax[i], c.ay[i], c.ex[i], c.ey[i], c.ix[i], c.iy[i], c.tau0[i], c.dtau[i], c.bow[i]};
  }
  static Ends<float> lane(const Ends<v4f> &e, int i) { return {{e.a.x[i], e.a.y[i]}, {e.b.x[i], e.b.y[i]}, e.turn[i], e.length[i]}; }

  // The chords of the arcs in lanes begin .. end of k, in order; each begins at t0 and is dt long in the piece's parameter.
  template <class S> void chords(Flat<S> &out, Arc<v4f> &k, v4f t0, float dt, int depth, int begin, int end) {
    const v4i lanes = {0, 1, 2, 3}, in = (lanes >= begin) & (lanes < end);
    v4i gone = {}, cut = in;
    Chord<v4f> chord;
    Ends<v4f> ends;
    Arc<v4f> half[2];
    if (depth >= sure_depth_ || partly_outside_) project(k);
    if (partly_outside_) gone = outside(k);
    if (depth >= sure_depth_) {
      v4f across;
      cut &= depth == MAX_CHORD_DEPTH ? v4i{} : crooked(k, across);
      if (any_lane(in & ~cut)) {
        ends = ends_of(k), chord = make_chord(k, t0, dt);
        if (depth < MAX_CHORD_DEPTH) cut |= in & sharp(ends, across, reach_, outline_);
      }
    }
    if (any_lane(cut & ~gone)) halve(k.x, half[0].x, half[1].x), halve(k.y, half[0].y, half[1].y), halve(k.z, half[0].z, half[1].z);
    const v4f later = t0 + dt / 2;
    for (int i = begin; i < end; i++) {
      if (gone[i]) gap_ = true;
      else if (!cut[i]) add_chord(out, lane(chord, i), lane(ends, i));
      else {
        const bool pair = i % 2 == 0 && i + 1 < end && cut[i + 1] && !gone[i + 1];
        const int at = i % 2 * 2, j = i / 2 * 2;
        chords(out, half[i / 2], v4f{t0[j], later[j], t0[j + 1], later[j + 1]}, dt / 2, depth + 1, at, pair ? 4 : at + 2);
        i += pair;
      }
    }
  }

  template <class S> void add_piece(Flat<S> &out, const Control &k, const v4d *p, double start, double stop, const Piece<S> &appearance) {
    Piece<S> c = appearance;
    const Arc<float> arc = make_piece(k, p, c);
    c.parabola2 = S(parabola_step2(c, float(low(k.c, 2))));
    PieceInfo info{};
    info.stroke = segment_.stroke, info.segment = segment_.index, info.start = start, info.stop = stop;
    info.first_chord = uint32_t(out.chords.size());
    info.cap_start = start == span_start_ && !(segment_.joined_start && start == 0);
    info.cap_stop = stop == span_stop_ && !(segment_.joined_stop && stop == 1);
    blossom(start, stop, info.map);
    if (segment_.widths) place_widths(segment_.widths, info.map, c.half_width);
    out.pieces.add(c);
    out.piece_info.add(info);
    bend_ += SHARP;
    partly_outside_ = !frame_.inside(p) && !c.oblong;  // arcs of oblong pieces are not in pixels
    left_ = float(frame_.left - c.ox), right_ = float(frame_.right - c.ox), top_ = float(frame_.top - c.oy), bottom_ = float(frame_.bottom - c.oy);
    sure_depth_ = sure_depth(arc);
    Arc<v4f> whole;  // in every lane, of which the first counts
    for (int i = 0; i < 4; i++) whole.x[i] = v4f{} + arc.x[i], whole.y[i] = v4f{} + arc.y[i], whole.z[i] = v4f{} + arc.z[i];
    chords(out, whole, v4f{}, 1, 0, 0, 1);
    if (out.chords.size() == info.first_chord) {
      out.pieces.shorten(out.pieces.size() - 1), out.piece_info.shorten(out.piece_info.size() - 1);
      return;
    }
    out.piece_info[out.piece_info.size() - 1].end_chord = uint32_t(out.chords.size());
  }

  // Cuts a visible span until its parts are tame, dropping those off the image.
  template <class S> void pieces(Flat<S> &out, const Control &k, double start, double stop, int depth, const Piece<S> &appearance) {
    if (positive(k)) {
      v4d p[4];
      for (int i = 0; i < 4; i++) p[i] = on_screen(k.c[i]);
      if (frame_.outside(p)) {
        gap_ = true;
        return;
      }
      if (depth == MAX_DEPTH || tame(k, p)) return add_piece(out, k, p, start, stop, appearance);
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
    pieces(out, a, start, middle, depth + 1, appearance), pieces(out, b, middle, stop, depth + 1, appearance);
  }

  template <class S> void span(Flat<S> &out, double a, double b, const Piece<S> &appearance) {
    span_start_ = a, span_stop_ = b, gap_ = true;
    double map[16];
    blossom(a, b, map);
    pieces(out, a == 0 && b == 1 ? whole_ : mapped(whole_, map), a, b, 0, appearance);
  }

public:
  // Visible spans: where the margin of depth over near, a cubic, is positive. Halves intervals until the coefficients agree on a sign; f(a, b) in order.
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

  // Adds one segment: cubic 4 x (X, Y, Z, W), normalised so that the largest weight is 1. reach: px beyond which its stroke covers nothing.
  template <class S> void add(Flat<S> &out, const double *cubic, double near, double reach, const Segment &segment, const Piece<S> &appearance) {
    double margin[4];
    for (int i = 0; i < 4; i++) {
      whole_.c[i] = v4d{cubic[4 * i], cubic[4 * i + 1], cubic[4 * i + 2], cubic[4 * i + 3]};
      margin[i] = near_margin(whole_.c[i], near, appearance.orthographic);
    }
    const double old = reach_;
    frame_.left -= reach - old, frame_.top -= reach - old, frame_.right += reach - old, frame_.bottom += reach - old;
    reach_ = reach, segment_ = segment, bend_ = 0, cuts_ = 0, gap_ = true;
    visible_spans(margin, [&](double a, double b) { span(out, a, b, appearance); });
  }
};
}  // namespace stroke
