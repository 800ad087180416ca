// Boxes in the plane or in space that meet those of an index, as page/boxes.py makes it.
#include "cpu/boxes/module.h"
#include "cpu/arrays.h"
#include <algorithm>
#include <cmath>
#include <vector>
using namespace nb::literals;

namespace stroke::boxes {
namespace {
struct Index {
  In<double> origin;        // (D,)
  double cell;              // side of the finest grid's cells
  int bits;                 // of a cell's number along an axis
  In<int64_t> levels;       // the grids that hold boxes
  In<int64_t> keys, boxes;  // of the entries: grid and cell, rising; the box
  In<double> lows, highs;   // (N, D)
};
struct Pairs {
  std::vector<int64_t> query, box;
};

// The entries of one cell whose boxes meet the given one.
template <int D> void look(const Index &index, int64_t key, int64_t query, const double *low, const double *high, Pairs &out) {
  const int64_t *keys = index.keys.data(), *end = keys + index.keys.size();
  for (const int64_t *k = std::lower_bound(keys, end, key); k < end && *k == key; k++) {
    const int64_t box = index.boxes.data()[k - keys];
    const double *least = index.lows.data() + D * box, *most = index.highs.data() + D * box;
    bool met = true;
    for (int d = 0; d < D; d++) met &= least[d] <= high[d] && low[d] <= most[d];
    if (met) out.query.push_back(query), out.box.push_back(box);
  }
}

// All entries of a grid whose boxes meet the given one, cell by cell.
template <int D> void look_in_grid(const Index &index, int64_t level, int64_t query, const double *low, const double *high, Pairs &out) {
  const double side = std::ldexp(index.cell, int(level)), limit = double((int64_t(1) << index.bits) - 1);
  int64_t first[D], last[D], at[D];
  for (int d = 0; d < D; d++) {
    const double begin = std::floor((low[d] - index.origin.data()[d]) / side), stop = std::floor((high[d] - index.origin.data()[d]) / side);
    if (!(begin <= limit && stop >= 0)) return;
    at[d] = first[d] = int64_t(std::max(begin, 0.0)), last[d] = int64_t(std::min(stop, limit));
  }
  for (int axis = D - 1; axis >= 0;) {
    int64_t key = level;
    for (int d = 0; d < D; d++) key = key << index.bits | at[d];
    look<D>(index, key, query, low, high, out);
    for (axis = D - 1; axis >= 0 && ++at[axis] > last[axis]; axis--) at[axis] = first[axis];
  }
}

// Pairs of given boxes from the first on, until there are `most` or no boxes are left; and the box at which to go on.
template <int D> int64_t meeting(const Index &index, const In<double> &low, const In<double> &high, int64_t first, int64_t most, Pairs &out) {
  const int64_t count = int64_t(low.shape(0));
  for (; first < count && int64_t(out.box.size()) < most; first++)
    for (size_t l = 0; l < index.levels.size(); l++)
      look_in_grid<D>(index, index.levels.data()[l], first, low.data() + D * first, high.data() + D * first, out);
  return first;
}

Out<int64_t> given(const std::vector<int64_t> &values) {
  Buffer<int64_t> copy(values.size());
  std::copy(values.begin(), values.end(), copy.get());
  return array(std::move(copy), {values.size()});
}

nb::tuple py_meeting(const nb::tuple &tables, double cell, int bits, nb::object low, nb::object high, int64_t first, int64_t most) {
  require(tables.size() == 6 && cell > 0, "an index must be origin, levels, keys, boxes, lows and highs, and the side of a cell");
  const Index index = {
      In<double>(tables[0]), cell, bits, In<int64_t>(tables[1]), In<int64_t>(tables[2]), In<int64_t>(tables[3]), In<double>(tables[4]),
      In<double>(tables[5])};
  const In<double> lows(low), highs(high);
  const size_t D = index.origin.size();
  require((D == 2 || D == 3) && bits > 0 && bits * int(D) < 60, "boxes must have two or three axes");
  require(lows.ndim() == 2 && lows.shape(1) == D && has_shape(highs, {lows.shape(0), D}), "low and high must have shape (Q, D)");
  require(index.lows.ndim() == 2 && index.lows.shape(1) == D && has_shape(index.highs, {index.lows.shape(0), D}) &&
              has_shape(index.boxes, {index.keys.size()}) && first >= 0,
          "lows and highs must have shape (N, D), keys and boxes be as many");
  for (size_t k = 0; k < index.boxes.size(); k++) require(uint64_t(index.boxes.data()[k]) < index.lows.shape(0), "an entry must be of a box");
  Pairs out;
  {
    nb::gil_scoped_release nogil;
    first = D == 2 ? meeting<2>(index, lows, highs, first, most, out) : meeting<3>(index, lows, highs, first, most, out);
  }
  return nb::make_tuple(given(out.query), given(out.box), first);
}
}  // namespace

void bind(nb::module_ &m) { m.def("boxes_meeting", &py_meeting, "tables"_a, "cell"_a, "bits"_a, "low"_a, "high"_a, "first"_a, "most"_a); }
}  // namespace stroke::boxes
