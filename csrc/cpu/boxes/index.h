// An index of boxes in the plane or in space, as page/boxes.py makes it: grids of cells, each twice as coarse as the one before.
#pragma once
#include "cpu/arrays.h"
#include <algorithm>
#include <cmath>

namespace stroke::boxes {
struct Index {
  In<double> origin;        // (D,)
  double cell;              // side of the finest grid's cells
  int bits;                 // of a cell's number along an axis
  In<int64_t> levels;       // the grids that hold boxes
  In<int64_t> keys, boxes;  // of the entries: grid and cell, rising; the box
  In<double> lows, highs;   // (N, D)

  Index(const nb::tuple &tables, double cell, int bits) : cell(cell), bits(bits) {
    require(tables.size() == 6 && cell > 0, "an index must be origin, levels, keys, boxes, lows and highs, and the side of a cell");
    origin = In<double>(tables[0]), levels = In<int64_t>(tables[1]), keys = In<int64_t>(tables[2]), boxes = In<int64_t>(tables[3]);
    lows = In<double>(tables[4]), highs = In<double>(tables[5]);
    require((axes() == 2 || axes() == 3) && bits > 0 && bits * int(axes()) < 60, "boxes must have two or three axes");
    require(lows.ndim() == 2 && lows.shape(1) == axes() && has_shape(highs, {lows.shape(0), axes()}), "lows and highs must have shape (N, D)");
    require(has_shape(boxes, {keys.size()}), "keys and boxes must be as many");
    for (size_t k = 0; k < boxes.size(); k++) require(uint64_t(boxes.data()[k]) < lows.shape(0), "an entry must be of a box");
  }
  size_t axes() const { return origin.size(); }

  // f(box) of each box that meets the given one, some twice, until one gives true.
  template <int D, class F> void visit(const double *low, const double *high, F &&f) const {
    for (size_t l = 0; l < levels.size(); l++)
      if (visit_grid<D>(levels.data()[l], low, high, f)) return;
  }

private:
  template <int D, class F> bool visit_grid(int64_t level, const double *low, const double *high, F &f) const {
    const double side = std::ldexp(cell, int(level)), limit = double((int64_t(1) << bits) - 1);
    int64_t first[D], last[D], at[D];
    for (int d = 0; d < D; d++) {
      const double begin = std::floor((low[d] - origin.data()[d]) / side), stop = std::floor((high[d] - origin.data()[d]) / side);
      if (!(begin <= limit && stop >= 0)) return false;
      at[d] = first[d] = int64_t(std::max(begin, 0.0)), last[d] = int64_t(std::min(stop, limit));
    }
    for (int axis = D - 1; axis >= 0;) {
      int64_t key = level;
      for (int d = 0; d < D; d++) key = key << bits | at[d];
      if (visit_cell<D>(key, low, high, f)) return true;
      for (axis = D - 1; axis >= 0 && ++at[axis] > last[axis]; axis--) at[axis] = first[axis];
    }
    return false;
  }
  template <int D, class F> bool visit_cell(int64_t key, const double *low, const double *high, F &f) const {
    const int64_t *begin = keys.data(), *end = begin + keys.size();
    for (const int64_t *k = std::lower_bound(begin, end, key); k < end && *k == key; k++) {
      const int64_t box = boxes.data()[k - begin];
      const double *least = lows.data() + D * box, *most = highs.data() + D * box;
      bool met = true;
      for (int d = 0; d < D; d++) met &= least[d] <= high[d] && low[d] <= most[d];
      if (met && f(box)) return true;
    }
    return false;
  }
};
}  // namespace stroke::boxes
