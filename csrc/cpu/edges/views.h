// Ridges of views, and which of them lies nearest to where a point appears, as edges/evidence/edge_views.py has them.
#pragma once
#include "cpu/arrays.h"
#include <algorithm>
#include <cmath>

namespace stroke::edges {
template <class S> struct Views {
  In<S> projection;     // (V, 3, 4)
  In<int32_t> nearest;  // (V, H, W)
  In<S> ridges;         // (2, R): columns and rows

  explicit Views(const nb::tuple &tables) {
    require(tables.size() == 3, "views must be projections, nearest ridges, and where the ridges are");
    projection = In<S>(tables[0]), nearest = In<int32_t>(tables[1]), ridges = In<S>(tables[2]);
    require(nearest.ndim() == 3 && has_shape(projection, {count(), 3, 4}), "projections must have shape (V, 3, 4), nearest ridges (V, H, W)");
    require(ridges.ndim() == 2 && ridges.shape(0) == 2, "ridges must have shape (2, R)");
  }
  size_t count() const { return nearest.shape(0); }
  size_t pixels() const { return nearest.shape(1) * nearest.shape(2); }

  struct Match {
    S column, row, depth;
    int32_t ridge = -1;  // none where the view does not contain the point, or has no ridges
    size_t pixel;
    S square;  // of the distance, pixels
  };
  // Where a point appears.
  Match project(size_t view, const S *x) const {
    const S *p = projection.data() + 12 * view;
    S h[3];
    for (int k = 0; k < 3; k++, p += 4) h[k] = p[0] * x[0] + p[1] * x[1] + p[2] * x[2] + p[3];
    const S by = h[2] == 0 ? S(1e-12) : h[2];
    Match found;
    found.column = h[0] / by, found.row = h[1] / by, found.depth = h[2];
    return found;
  }
  Match match(size_t view, const S *x) const { return matched(view, project(view, x)); }
  // With the ridge nearest to where it appears.
  Match matched(size_t view, Match found) const {
    const S column = found.column, row = found.row;
    const size_t height = nearest.shape(1), width = nearest.shape(2), R = ridges.shape(1);
    if (!(found.depth > 0 && column >= 0 && row >= 0 && column < S(width) && row < S(height))) return found;
    found.pixel = size_t(row) * width + size_t(column);
    const int32_t ridge = nearest.data()[view * pixels() + found.pixel];
    if (uint32_t(ridge) >= R) return found;
    found.ridge = ridge;
    const S across = ridges.data()[ridge] - column, down = ridges.data()[R + ridge] - row;
    found.square = across * across + down * down;
    return found;
  }
};
}  // namespace stroke::edges
