// Which strokes and segments each view sees: all there are or, in a batch of sketches, those of its own sketch. A row is a pair of a view and a
// stroke, or of a view and a segment; rows are in the order of sketches, and of each sketch in that of its views.
#pragma once
#include "common/scalar.h"

namespace stroke {
enum Kind { STROKES, SEGMENTS };

struct Layout {
  int views, strokes, segments;
  int sketches;      // of a batch
  const int *batch;  // (5, sketches + 1), of each sketch its first view, stroke, segment, row of strokes and row of segments; null: one sketch
  HD int count(Kind kind) const { return kind == STROKES ? strokes : segments; }
  HD int first_view(int sketch) const { return batch[sketch]; }
  HD int first(Kind kind, int sketch) const { return batch[(1 + kind) * (sketches + 1) + sketch]; }
  HD int first_row(Kind kind, int sketch) const { return batch[(3 + kind) * (sketches + 1) + sketch]; }
  HD unsigned long long rows(Kind kind) const { return batch ? first_row(kind, sketches) : (unsigned long long)(views)*count(kind); }
};

// The last sketch whose first number is not greater: the one that holds it.
template <class First> HD int sketch_with(const Layout &l, int number, First first) {
  int low = 0, high = l.sketches;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (first(middle) <= number ? low : high) = middle;
  }
  return low;
}

struct Seen {
  int view, index;  // index: of the stroke or segment
};
HD Seen seen_in(const Layout &l, Kind kind, unsigned row) {
  const unsigned all = l.count(kind);
  if (!l.batch) return {int(row / all), int(row % all)};
  const int b = sketch_with(l, int(row), [&](int s) { return l.first_row(kind, s); });
  const int within = int(row) - l.first_row(kind, b), count = l.first(kind, b + 1) - l.first(kind, b);
  return {l.first_view(b) + within / count, l.first(kind, b) + within % count};
}

// The rows of one stroke or segment in the views of its sketch.
struct Rows {
  int first_view, end_view;
  unsigned first_row, stride;
  HD unsigned at(int view) const { return first_row + (view - first_view) * stride; }
};
HD Rows rows_of(const Layout &l, Kind kind, int index) {
  if (!l.batch) return {0, l.views, unsigned(index), unsigned(l.count(kind))};
  const int b = sketch_with(l, index, [&](int s) { return l.first(kind, s); }), first = l.first(kind, b);
  return {l.first_view(b), l.first_view(b + 1), unsigned(l.first_row(kind, b) + index - first), unsigned(l.first(kind, b + 1) - first)};
}

// The segments that a view sees, and the row of the first.
struct SegmentsSeen {
  int first, end;
  unsigned first_row;
};
HD SegmentsSeen segments_of(const Layout &l, int view) {
  if (!l.batch) return {0, l.segments, unsigned(view) * l.segments};
  const int b = sketch_with(l, view, [&](int s) { return l.first_view(s); });
  const int first = l.first(SEGMENTS, b), end = l.first(SEGMENTS, b + 1);
  return {first, end, unsigned(l.first_row(SEGMENTS, b) + (view - l.first_view(b)) * (end - first))};
}
}  // namespace stroke
