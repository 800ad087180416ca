// Strokes flattened and binned, in chunks over threads: which chords of which strokes may reach each tile. Included by driver.cpp only.
#pragma once
#include "common/bin.h"
#include "cpu/driver.h"
#include <algorithm>

namespace stroke {
namespace {
constexpr int CHUNK = 16;  // strokes flattened at a time

// What one thread needs to flatten strokes.
struct Binner {
  Buffer<uint32_t> mark;  // per tile: 1 + its intersection with the current stroke
  explicit Binner(size_t tiles) : mark(tiles) { std::fill_n(mark.get(), tiles, 0); }
};

// What a chunk of strokes leaves, with indices of its own.
template <class S> struct Part {
  Flat<S> flat;
  List<typename State<S>::StrokeIntersection> stroke_intersections;
  void clear() {
    flat.pieces.shorten(0), flat.piece_info.shorten(0), flat.chords.shorten(0), flat.chord_info.shorten(0), flat.tangents.shorten(0);
    stroke_intersections.shorten(0);
  }
};

// Parts of the last calls, for their memory.
template <class S> std::vector<Part<S>> &parts_of(size_t chunks) {
  static auto *parts = new std::vector<Part<S>>;
  if (parts->size() < chunks) parts->resize(chunks);
  for (auto &p : *parts) p.clear();
  return *parts;
}
template <class S> void check(const Input<S> &in, size_t i, const double *cubic, double half_width, const S *color, double opacity) {
  if (drawable(cubic, in.options.orthographic, half_width, color, opacity)) return;
  const Seen seen = seen_in(in.layout, STROKES, i);
  throw InvalidStroke("stroke " + std::to_string(seen.index) + " in view " + std::to_string(seen.view));
}

// A stroke in one view: its row, those of its segments, and the numbers of both.
struct StrokeRow {
  size_t row, segment_row;
  int view, n, first, end;  // first, end: its segments
  StrokeRow(const Layout &layout, const Chains &chains, size_t i) : row(i) {
    const Seen seen = seen_in(layout, STROKES, i);
    view = seen.view, n = seen.index, first = chains.first_of(n), end = chains.first_of(n + 1);
    segment_row = rows_of(layout, SEGMENTS, first).at(view);
  }
  size_t row_of(int m) const { return segment_row + (m - first); }
};

// Half widths of segment m of a stroke at its control points: they are given so, or all are that of the stroke.
template <class S> void widths_of(const Input<S> &in, const StrokeRow &stroke, int m, double *out) {
  const S scale = S(in.options.width_scale);
  const size_t of_segment = in.half_width_per_view ? stroke.row_of(m) : m, of_stroke = in.half_width_per_view ? stroke.row : stroke.n;
  for (int k = 0; k < 4; k++) out[k] = in.half_width_along ? scale * in.half_width[4 * of_segment + k] : scale * in.half_width[of_stroke];
}

// px beyond which no segment of a stroke covers anything. Finds their scales.
template <class S> double measure_stroke(State<S> &st, const StrokeRow &stroke) {
  const Input<S> &in = st.input;
  const int n = stroke.n;
  const double stretch = stretch_of(in.square_of(stroke.view));
  double reach = 0;
  for (int m = stroke.first; m < stroke.end; m++) {
    const size_t at = stroke.row_of(m);
    const double *given = in.cubics + 16 * at;
    double widths[4], cubic[16], largest = 0, widest = 0;
    widths_of(in, stroke, m, widths);
    for (int k = 0; k < (in.half_width_along ? 4 : 1); k++)
      check(in, stroke.row, given, widths[k], in.color + 3 * n, in.opacity[n]), widest = std::max(widest, widths[k]);
    for (int k = weight_place(in.options.orthographic); k < 16; k += 4) largest = std::max(largest, given[k]);
    st.scale[at] = 1 / largest;
    for (int k = 0; k < 16; k++) cubic[k] = given[k] * st.scale[at];
    reach = std::max(reach, reach_of(cubic, widest, in.options.world, in.options.near, st.job.filter.reach, in.width, in.height, stretch));
  }
  return reach;
}

template <class S> void flatten_stroke(State<S> &st, Flattener &flattener, size_t i, Part<S> &part) {
  const Input<S> &in = st.input;
  const StrokeRow stroke(in.layout, in.chains, i);
  const int n = stroke.n, first = stroke.first, last = stroke.end - 1;
  const bool closed = in.chains.first && in.chains.closed[n];
  const double reach = measure_stroke(st, stroke);
  st.reach[i] = S(reach);
  Piece<S> appearance{};
  appearance.opacity = in.opacity[n], appearance.orthographic = in.options.orthographic;
  for (int k = 0; k < 3; k++) appearance.color[k] = in.color[3 * n + k];
  set_square(appearance, in.square_of(stroke.view), in.options.differ_squares);
  const uint32_t first_piece = uint32_t(part.flat.pieces.size());
  for (int m = first; m <= last; m++) {
    const size_t at = stroke.row_of(m), pieces = part.flat.pieces.size();
    double widths[4], cubic[16];
    widths_of(in, stroke, m, widths);
    appearance.half_width[0] = S(widths[0]);
    for (int k = 0; k < 16; k++) cubic[k] = in.cubics[16 * at + k] * st.scale[at];
    const Segment segment = {uint32_t(i), uint32_t(at), m > first || closed, m < last || closed, in.half_width_along ? widths : nullptr};
    flattener.add(part.flat, cubic, in.options.near, reach, segment, appearance);
    st.piece_first[at + 1] = uint32_t(part.flat.pieces.size() - pieces);
  }
  const uint32_t end = uint32_t(part.flat.pieces.size());
  for (uint32_t p = first_piece; p < end; p++) {
    PieceInfo &info = part.flat.piece_info[p];
    info.before = info.cap_start ? NO_PIECE : p > first_piece ? p - 1 : closed ? end - 1 : NO_PIECE;
  }
}

// The tiles that the stroke whose chords start at `first_chord` meets, each with the range of chords that may reach it: one range, or several with
// pieces between them that reach it nowhere.
template <class S> void bin_stroke(const State<S> &st, size_t i, uint32_t first_chord, Binner &binner, Part<S> &part) {
  const Job<S> &J = st.job;
  const float R = float(st.reach[i]);
  const uint32_t first_tile = uint32_t(seen_in(st.input.layout, STROKES, i).view) * J.tiles_x * J.tiles_y,
                 first_intersection = uint32_t(part.stroke_intersections.size());
  for (uint32_t s = first_chord; s < part.flat.chords.size(); s++)
    visit_tiles(part.flat.chords[s], part.flat.chord_info[s].length, R, J.strata > 0, J.tiles_x, J.tiles_y, [&](int tx, int ty) {
      uint32_t &mark = binner.mark[ty * J.tiles_x + tx];
      if (!mark || part.flat.chord_info[s].piece > part.flat.chord_info[part.stroke_intersections[mark - 1].last].piece + 1) {
        part.stroke_intersections.add({first_tile + uint32_t(ty * J.tiles_x + tx), uint32_t(i), s, s, 0, 0, 0, false});
        mark = uint32_t(part.stroke_intersections.size());
      }
      part.stroke_intersections[mark - 1].last = s;
    });
  for (uint32_t k = first_intersection; k < part.stroke_intersections.size(); k++) {
    auto &t = part.stroke_intersections[k];
    const ChordInfo &a = part.flat.chord_info[t.first], &b = part.flat.chord_info[t.last];
    t.piece = a.piece, t.pieces = b.piece - a.piece + 1, t.smooth = a.piece == b.piece && smooth(a, b);
    binner.mark[t.tile - first_tile] = 0;
  }
}

// From counts behind each index to the first of each.
void add_up(Buffer<uint32_t> &first, size_t count) {
  first[0] = 0;
  for (size_t i = 0; i < count; i++) first[i + 1] += first[i];
}

// Joins the parts of all chunks in order: results do not depend on which thread did what.
template <class S> void join_parts(State<S> &st, const std::vector<Part<S>> &parts) {
  Flat<S> &flat = st.flat;
  struct Start {
    uint32_t chord, piece, intersection;
  };
  std::vector<Start> starts;
  size_t chords = 0, pieces = 0, stroke_intersections = 0, tangents = 0;
  for (auto &p : parts) {
    starts.push_back({uint32_t(chords), uint32_t(pieces), uint32_t(stroke_intersections)});
    chords += p.flat.chords.size(), pieces += p.flat.pieces.size(), stroke_intersections += p.stroke_intersections.size(),
        tangents += p.flat.tangents.size();
  }
  if (chords > UINT32_MAX / 2 || stroke_intersections > UINT32_MAX / 2) throw std::bad_alloc();
  st.piece_stroke = Buffer<uint32_t>(pieces + 1);
  flat.pieces.extend(pieces), flat.piece_info.extend(pieces), flat.chords.extend(chords), flat.chord_info.extend(chords);
  flat.tangents.extend(tangents), st.stroke_intersections.extend(stroke_intersections);
  threads().run(int(parts.size()), 1, [&](int k, int) {
    const Part<S> &p = parts[k];
    const Start at = starts[k];
    auto put = [](const auto &to, const auto &from, uint32_t i) {
      if (from.size()) std::memcpy(static_cast<void *>(to.begin() + i), from.begin(), from.size() * sizeof(*from.begin()));
    };
    put(flat.pieces, p.flat.pieces, at.piece), put(flat.piece_info, p.flat.piece_info, at.piece);
    put(flat.chords, p.flat.chords, at.chord), put(flat.chord_info, p.flat.chord_info, at.chord), put(flat.tangents, p.flat.tangents, at.chord);
    put(st.stroke_intersections, p.stroke_intersections, at.intersection);
    for (size_t i = at.piece; i < at.piece + p.flat.pieces.size(); i++) {
      PieceInfo &info = flat.piece_info[i];
      info.first_chord += at.chord, info.end_chord += at.chord;
      if (info.before != NO_PIECE) info.before += at.piece;
      st.piece_stroke[i] = info.stroke;
    }
    for (size_t i = at.chord; i < at.chord + p.flat.chords.size(); i++) flat.chord_info[i].piece += at.piece;
    for (size_t i = at.intersection; i < at.intersection + p.stroke_intersections.size(); i++)
      st.stroke_intersections[i].first += at.chord, st.stroke_intersections[i].last += at.chord, st.stroke_intersections[i].piece += at.piece;
  });
}

// Intersections by tile, there in the order of strokes (a counting sort), and in that order a slot for every piece of each.
template <class S> void sort_by_tile(State<S> &st) {
  const size_t tiles = size_t(st.job.views) * st.job.tiles_x * st.job.tiles_y;
  st.tile_first = Buffer<uint32_t>(tiles + 1), st.intersections = Buffer<Intersection>(st.stroke_intersections.size() + 1);
  uint32_t *first = st.tile_first.get();
  std::fill_n(first, tiles + 1, 0);
  for (auto &t : st.stroke_intersections) first[t.tile]++;
  uint32_t total = 0;
  for (size_t i = 0; i <= tiles; i++) total += std::exchange(first[i], total);
  for (auto &t : st.stroke_intersections) {
    t.intersection = first[t.tile]++;
    st.intersections[t.intersection] = {t.stroke, t.first, t.last, t.piece, t.pieces, 0, t.smooth};
  }
  for (size_t i = tiles; i > 0; i--) first[i] = first[i - 1];
  first[0] = 0;
  uint32_t slot = 0;
  for (size_t i = 0; i < st.stroke_intersections.size(); i++) {
    Intersection &e = st.intersections[i];
    e.slot = slot, slot += e.pieces;
  }
  st.intersections[st.stroke_intersections.size()] = {0, 0, 0, 0, 0, slot, false};
}
}  // namespace
}  // namespace stroke
