// How far points are from forms, forms fitted to points, and pieces of the samples that are on one.
#include "cpu/forms/module.h"
#include "cpu/arrays.h"
#include "cpu/forms/form.h"
#include <nanobind/stl/vector.h>
#include <vector>
using namespace nb::literals;

namespace stroke::forms {
namespace {
// Centre, axis, radius, angle and ring.
constexpr size_t ROW = 9;

Form form_of(int kind, const double *row) { return {Kind(kind), {row[0], row[1], row[2]}, {row[3], row[4], row[5]}, row[6], row[7], row[8]}; }

// A row a coordinate: what goes from point to point is quick then.
std::vector<double> transposed(const In<double> &points) {
  const size_t count = points.shape(0);
  std::vector<double> out(3 * count);
  for (size_t s = 0; s < count; s++)
    for (size_t k = 0; k < 3; k++) out[k * count + s] = points.data()[3 * s + k];
  return out;
}

nb::tuple py_measured(int kind, nb::object forms, nb::object points, nb::object normals) {
  const In<double> rows(forms), places(points), ways(normals);
  const size_t F = rows.shape(0), S = places.shape(0);
  require(kind >= PLANE && kind <= TORUS && rows.ndim() == 2 && has_shape(rows, {F, ROW}), "forms must be of a kind, with shape (F, 9)");
  require(has_shape(places, {S, 3}) && has_shape(ways, {S, 3}), "points and normals must have shape (S, 3)");
  Buffer<double> distance(F * S), cosine(F * S);
  {
    nb::gil_scoped_release nogil;
    const std::vector<double> place = transposed(places), way = transposed(ways);
    const double *x[3] = {place.data(), place.data() + S, place.data() + 2 * S}, *n[3] = {way.data(), way.data() + S, way.data() + 2 * S};
    for (size_t f = 0; f < F; f++) measure(form_of(kind, rows.data() + ROW * f), x, n, S, distance.get() + f * S, cosine.get() + f * S);
  }
  return nb::make_tuple(array(std::move(distance), {F, S}), array(std::move(cosine), {F, S}));
}

Out<double> py_fitted(int kind, nb::object numbers, nb::object points, double scale, const std::vector<int> &free, double size, double settled) {
  const In<double> row(numbers), places(points);
  require(kind >= PLANE && kind <= TORUS && has_shape(row, {ROW}) && has_shape(places, {places.shape(0), 3}),
          "a form must be of a kind, with nine numbers, and points must have shape (S, 3)");
  require(free.size() <= size_t(NUMBERS), "a form has eight numbers that move");
  for (int k : free) require(k >= 0 && k < NUMBERS, "a form has eight numbers that move");
  Buffer<double> out(ROW);
  {
    nb::gil_scoped_release nogil;
    Form f = form_of(kind, row.data());
    fit(f, places.data(), places.shape(0), scale, free.data(), int(free.size()), size, settled);
    double *to = out.get();
    for (int k = 0; k < 3; k++) to[k] = f.center[k], to[3 + k] = f.axis[k];
    to[6] = f.radius, to[7] = f.angle, to[8] = f.ring;
  }
  return array(std::move(out), {ROW});
}
// A place in as many numbers, of a graph that may not be one: only what is visited is looked at.
size_t at(int32_t place, size_t count) {
  require(size_t(place) < count, "a graph must have the numbers of its nodes");
  return place;
}

// Of some of the nodes of a graph, as scipy has it, the largest connected piece, the first one of those that are as large; rising.
Out<int64_t> py_largest_piece(nb::object indptr, nb::object indices, nb::object some) {
  const In<int32_t> starts(indptr), neighbours(indices);
  const In<int64_t> rows(some);
  const size_t nodes = starts.size() - 1;
  require(starts.size() > 0 && starts.data()[nodes] == int32_t(neighbours.size()), "a graph must have the rows of its neighbours");
  for (size_t k = 0; k < rows.size(); k++) require(uint64_t(rows.data()[k]) < nodes, "some must be nodes of the graph");
  std::vector<int64_t> largest;
  {
    nb::gil_scoped_release nogil;
    std::vector<char> left(nodes);
    std::vector<int64_t> piece;
    for (size_t k = 0; k < rows.size(); k++) left[rows.data()[k]] = 1;
    for (size_t k = 0; k < rows.size(); k++) {
      if (!left[rows.data()[k]]) continue;
      piece.assign(1, rows.data()[k]), left[piece[0]] = 0;
      for (size_t next = 0; next < piece.size(); next++)
        for (int32_t e = starts.data()[piece[next]]; e < starts.data()[piece[next] + 1]; e++)
          if (const int32_t node = neighbours.data()[at(e, neighbours.size())]; left[at(node, nodes)]) left[node] = 0, piece.push_back(node);
      if (piece.size() > largest.size()) largest.swap(piece);
    }
    std::sort(largest.begin(), largest.end());
  }
  Buffer<int64_t> out(largest.size());
  std::copy(largest.begin(), largest.end(), out.get());
  return array(std::move(out), {largest.size()});
}
}  // namespace

void bind(nb::module_ &m) {
  m.def("forms_measured", &py_measured, "kind"_a, "forms"_a, "points"_a, "normals"_a);
  m.def("form_fitted", &py_fitted, "kind"_a, "numbers"_a, "points"_a, "scale"_a, "free"_a, "size"_a, "settled"_a);
  m.def("largest_piece", &py_largest_piece, "indptr"_a, "indices"_a, "some"_a);
}
}  // namespace stroke::forms
