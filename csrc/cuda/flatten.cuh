// Segments to pieces, one thread each, and pieces to chords, one warp each (docs/explanation/mathematics.md, section "Flattening"). Both walk twice: to
// count, and, when all know where to write, to write. What was not counted is never written: it would lie in another's place.
#pragma once
#include "cuda/warp.cuh"

namespace stroke {
// A segment as the flattening wants it: normalised so that the largest weight is 1.
struct Whole {
  Control control;
  Frame frame;
  double reach, scale, widths[4];
  Piece<real> appearance;
};
// The row of a stroke in a view, and of a segment.
__device__ inline u32 stroke_row(const Job &J, u32 view, u32 n) { return u32(rows_of(layout_of(J), STROKES, n).at(view)); }
__device__ inline u32 segment_row(const Job &J, u32 view, u32 m) { return u32(rows_of(layout_of(J), SEGMENTS, m).at(view)); }
// Half widths of the segment of row i at its control points.
__device__ inline void widths_of(const Job &J, u32 i, double *out) {
  const Seen seen = seen_in(layout_of(J), SEGMENTS, i);
  const u32 m = seen.index, n = stroke_of(J, m);
  const u64 of_segment = J.half_width_per_view ? i : m, of_stroke = J.half_width_per_view ? stroke_row(J, seen.view, n) : n;
  for (int k = 0; k < 4; k++) out[k] = J.half_width[J.along ? 4 * of_segment + k : of_stroke] * real(J.width_scale);
}
// px beyond which segment i covers nothing. Its cubic is as given, or scaled.
__device__ inline double reach_of_segment(const Job &J, u32 i, const double *cubic) {
  double widths[4];
  widths_of(J, i, widths);
  return reach_of(cubic, most(widths[0], widths[1], widths[2], widths[3]), J.world, J.near, J.filter_reach, J.width, J.height,
                  stretch_of(square_of(J, seen_in(layout_of(J), SEGMENTS, i).view)));
}
// False if it cannot be drawn.
__device__ inline bool load_segment(const Job &J, u32 i, Whole &s) {
  const Seen seen = seen_in(layout_of(J), SEGMENTS, i);
  const u32 n = stroke_of(J, seen.index);
  const double *cubic = J.cubics + 16 * u64(i);
  widths_of(J, i, s.widths);
  for (int k = 0; k < (J.along ? 4 : 1); k++)
    if (!drawable(cubic, J.orthographic, s.widths[k], J.color + 3 * n, double(J.opacity[n]))) return false;
  double largest = 0, scaled[16];
  for (int k = weight_place(J.orthographic); k < 16; k += 4) largest = most(largest, cubic[k]);
  s.scale = 1 / largest;
  for (int k = 0; k < 16; k++) scaled[k] = cubic[k] / largest, s.control.c[k / 4][k % 4] = scaled[k];
  // That of the stroke, if it was measured: the nearest of its segments counts, whichever is the widest.
  s.reach = J.stroke_first ? double(J.reach[stroke_row(J, seen.view, n)]) : reach_of_segment(J, i, scaled);
  s.frame = {-s.reach, J.width + s.reach, -s.reach, J.height + s.reach};
  s.appearance = {};
  s.appearance.half_width[0] = real(s.widths[0]), s.appearance.opacity = J.opacity[n], s.appearance.orthographic = J.orthographic;
  for (int k = 0; k < 3; k++) s.appearance.color[k] = J.color[3 * n + k];
  set_square(s.appearance, square_of(J, seen.view), J.differ_squares);
  return true;
}
// The reach of the stroke of row i, of several segments.
__device__ inline void measure_stroke(const Job &J, u32 i) {
  const Seen seen = seen_in(layout_of(J), STROKES, i);
  const u32 n = seen.index;
  double reach = 0;
  for (u32 m = first_of(J, n); m < first_of(J, n + 1); m++) {
    const u32 at = segment_row(J, seen.view, m);
    reach = most(reach, reach_of_segment(J, at, J.cubics + 16 * u64(at)));
  }
  J.reach[i] = real(reach);
}

// Visible spans: where the margin of depth over near, a cubic, is positive. f(a, b), at most twice.
template <class Visit> __device__ void visible_spans(const Control &k, double near, bool orthographic, Visit f) {
  double margin[4], map[16], open = -1;
  for (int i = 0; i < 4; i++) margin[i] = near_margin(k.c[i], near, orthographic);
  // Dyadic intervals, halved until the coefficients agree on a sign.
  u64 index = 0;
  for (int depth = 0;;) {
    const double a = double(index) / double(u64(1) << depth), b = double(index + 1) / double(u64(1) << depth);
    bool up = true, down = true;
    blossom(a, b, map);
    for (int i = 0; i < 4; i++) {
      double g = 0;
      for (int j = 0; j < 4; j++) g += map[4 * i + j] * margin[j];
      up = up && g > 0, down = down && g <= 0;
    }
    if (!up && !down && depth < MAX_DEPTH) {
      index *= 2, depth++;
      continue;
    }
    if (up && open < 0) open = a;
    if (!up && open >= 0) f(open, a), open = -1;
    for (index++; depth && index % 2 == 0;) index /= 2, depth--;
    if (depth == 0) break;
  }
  if (open >= 0) f(open, 1.);
}

// Cuts a visible span until its parts are tame, dropping those off the image: f(control, points on screen, start, stop).
template <class Visit> __device__ void visit_pieces(const Whole &s, double a, double b, Visit f) {
  double stops[MAX_DEPTH + 1], start = a;  // of the parts that are open, the next one last
  int open = 1, cuts = 0;
  for (stops[0] = b; open > 0;) {
    const double stop = stops[open - 1];
    double map[16];
    blossom(start, stop, map);
    const Control k = start == 0 && stop == 1 ? s.control : mapped(s.control, map);
    bool drop = high(k.c, 2) <= 0, done = open > MAX_DEPTH;
    if (positive(k)) {
      v4d p[4];
      for (int i = 0; i < 4; i++) p[i] = on_screen(k.c[i]);
      drop = s.frame.outside(p);
      if (!drop && (done || tame(k, p))) f(k, p, start, stop), drop = true;
    }
    if (drop || done || ++cuts > MAX_CUTS) start = stop, open--;
    else stops[open++] = start + (stop - start) * cut_at(k);
  }
}

// The piece that one goes on from, which begins segment i or follows the one at piece - 1 in it.
__device__ inline u32 piece_before(const Job &J, u32 i, u32 piece) {
  const Seen seen = seen_in(layout_of(J), SEGMENTS, i);
  const u32 n = stroke_of(J, seen.index), row = segment_row(J, seen.view, first_of(J, n));
  const u32 first = J.piece_first[row], end = J.piece_first[row + first_of(J, n + 1) - first_of(J, n)];
  return piece > first ? piece - 1 : J.closed && J.closed[n] ? end - 1 : NO_PIECE;
}

// The pieces of one segment in one view.
template <bool WRITE> __device__ void cut_segment(const Job &J, u32 i) {
  Whole s;
  u32 n = 0;
  const u32 at = WRITE ? J.piece_first[i] : 0, end = WRITE ? J.piece_first[i + 1] : 0;
  const Seen seen = seen_in(layout_of(J), SEGMENTS, i);
  const u32 m = seen.index, stroke = stroke_of(J, m);
  const bool closed = J.closed && J.closed[stroke];
  const bool joined_start = closed || m > first_of(J, stroke), joined_stop = closed || m + 1 < first_of(J, stroke + 1);
  const bool good = load_segment(J, i, s);
  if (!WRITE && !good) J.counters[BAD] = i + 1;
  if (good) {
    if (WRITE) J.scale[i] = s.scale;
    if (WRITE && !J.stroke_first) J.reach[i] = real(s.reach);
    visible_spans(s.control, J.near, J.orthographic, [&](double a, double b) {
      visit_pieces(s, a, b, [&](const Control &k, const v4d *p, double start, double stop) {
        const u32 piece = at + n++;
        if (!WRITE || piece >= end) return;
        Piece<real> c = s.appearance;
        J.arcs[piece] = make_piece(k, p, c);
        PieceInfo &info = J.piece_info[piece];
        info.stroke = stroke_row(J, seen.view, stroke), info.segment = i, info.start = start, info.stop = stop;
        info.cap_start = start == a && !(joined_start && start == 0), info.cap_stop = stop == b && !(joined_stop && stop == 1);
        info.before = info.cap_start ? NO_PIECE : piece_before(J, i, piece);
        blossom(start, stop, info.map);
        if (J.along) place_widths(s.widths, info.map, c.half_width);
        J.pieces[piece] = c;
      });
    });
  } else if (WRITE) {
    J.scale[i] = 0;
    if (!J.stroke_first) J.reach[i] = 0;
  }
  if (!WRITE) J.piece_first[i] = n;
}

// The arc of a piece over part `index` of 2^depth of its parameter.
__device__ inline Arc<float> part_of(const Arc<float> &k, int depth, u32 index) {
  if (depth == 0) return k;
  const float dt = 1 / float(1u << depth), t = float(index) * dt;
  float map[16];
  blossom(t, t + dt, map);
  Arc<float> out;
  for (int i = 0; i < 4; i++) {
    out.x[i] = out.y[i] = out.z[i] = 0;
    for (int j = 0; j < 4; j++) out.x[i] += map[4 * i + j] * k.x[j], out.y[i] += map[4 * i + j] * k.y[j], out.z[i] += map[4 * i + j] * k.z[j];
  }
  project(out);
  return out;
}

// The chords of part `index` of 2^depth of a piece, halved where they must be: f(arc, its ends, t0, dt), in order.
template <class Visit>
__device__ void visit_chords(const Arc<float> &whole, const Piece<real> &c, const Frame &frame, double reach, bool outline, int depth, u32 index,
                             Visit f) {
  const int top = depth;
  for (;;) {
    const Arc<float> k = part_of(whole, depth, index);
    if (!frame.outside(k, c)) {
      float across;
      Ends<float> e;
      const bool fine = !crooked(k, across) && (e = ends_of(k), !sharp(e, across, reach, outline));
      if (!fine && depth < MAX_CHORD_DEPTH) {
        index *= 2, depth++;
        continue;
      }
      if (!fine) e = ends_of(k);
      const float dt = 1 / float(1u << depth);
      f(k, e, float(index) * dt, dt);
    }
    if (depth == top) return;
    for (index++; depth > top && index % 2 == 0;) index /= 2, depth--;
    if (depth == top) return;
  }
}

// The chords of one piece, by one warp: a lane takes the parts that are halved without a question in its turn.
template <bool WRITE> __device__ void cut_piece(const Job &J, u32 piece) {
  const Arc<float> whole = J.arcs[piece];
  const Piece<real> &c = J.pieces[piece];
  const double reach = J.reach[J.piece_info[piece].stroke];
  const Frame frame = {-reach, J.width + reach, -reach, J.height + reach};
  const int depth = sure_depth(whole);
  u32 at = WRITE ? J.chord_first[piece] : 0, counted = 0;
  const u32 end = WRITE ? J.chord_first[piece + 1] : 0;
  if (WRITE && lane() == 0) J.piece_info[piece].first_chord = at, J.piece_info[piece].end_chord = end;
  for (u32 base = 0; base < 1u << depth; base += WARP) {
    const u32 index = base + lane();
    const bool active = index < 1u << depth;
    u32 n = 0, total;
    if (active) visit_chords(whole, c, frame, reach, J.strata > 0, depth, index, [&](const Arc<float> &, const Ends<float> &, float, float) { n++; });
    u32 next = at + warp_prefix(n, total);
    at += total, counted += total;
    if (!WRITE || !active) continue;
    visit_chords(whole, c, frame, reach, J.strata > 0, depth, index, [&](const Arc<float> &k, const Ends<float> &e, float t0, float dt) {
      if (next >= end) return;
      J.chords[next] = placed(make_chord(k, t0, dt), c);
      J.chord_info[next] = {piece, e.length, e.turn};
      J.tangents[next++] = {e.a.x, e.a.y, e.b.x, e.b.y};
    });
  }
  if (!WRITE && lane() == 0) J.chord_first[piece] = counted;
}
}  // namespace stroke
