// Boxes that meet those of an index, triangles in a picture that hide points, and triangles in space near them.
#include "cpu/boxes/module.h"
#include "cpu/boxes/index.h"
#include "cpu/boxes/nearest.h"
#include <vector>
using namespace nb::literals;

namespace stroke::boxes {
namespace {
struct Pairs {
  std::vector<int64_t> query, box;
};

// Pairs of given boxes from the first on, until there are `most` or no boxes are left; and the box at which to go on.
template <int D> int64_t meeting(const Index &index, const In<double> &low, const In<double> &high, int64_t first, int64_t most, Pairs &out) {
  const int64_t count = int64_t(low.shape(0));
  for (; first < count && int64_t(out.box.size()) < most; first++)
    index.visit<D>(low.data() + D * first, high.data() + D * first, [&](int64_t box) {
      out.query.push_back(first), out.box.push_back(box);
      return false;
    });
  return first;
}

Out<int64_t> given(const std::vector<int64_t> &values) {
  Buffer<int64_t> copy(values.size());
  std::copy(values.begin(), values.end(), copy.get());
  return array(std::move(copy), {values.size()});
}

nb::tuple py_meeting(const nb::tuple &tables, double cell, int bits, nb::object low, nb::object high, int64_t first, int64_t most) {
  const Index index(tables, cell, bits);
  const In<double> lows(low), highs(high);
  const size_t D = index.axes();
  require(lows.ndim() == 2 && lows.shape(1) == D && has_shape(highs, {lows.shape(0), D}) && first >= 0, "low and high must have shape (Q, D)");
  Pairs out;
  {
    nb::gil_scoped_release nogil;
    first = D == 2 ? meeting<2>(index, lows, highs, first, most, out) : meeting<3>(index, lows, highs, first, most, out);
  }
  return nb::make_tuple(given(out.query), given(out.box), first);
}

// Triangles in a picture, as hidden/mesh_view.py has them.
struct Triangles {
  In<int64_t> of_box;           // the triangle that each box of the index is around a part of
  In<double> corners, depths;   // (T, 3, 2), (T, 3)
  In<int64_t> vertices, edges;  // (T, 3), of the face that each is a part of; the numbers of all edges, rising
  int64_t count;                // an edge's number is its lesser vertex times this plus the other one
  int rings;
  double seam, touching;  // tolerances: in barycentric coordinates, and world units
  bool orthographic;

  // Whether a triangle lies in front of a point, to the bit as numpy finds it.
  bool before(int64_t t, const double *p, double depth) const {
    const double *c = corners.data() + 6 * t, *deep = depths.data() + 3 * t;
    const double ax = c[0] - p[0], ay = c[1] - p[1], bx = c[2] - p[0], by = c[3] - p[1], cx = c[4] - p[0], cy = c[5] - p[1];
    double share[3] = {bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx};
    const double area = share[0] + share[1] + share[2];
    if (area == 0) return false;
    for (double &s : share)
      if (!((s /= area) >= -seam)) return false;
    // Across a triangle depth is linear without perspective, and its inverse with it.
    const double at = orthographic ? share[0] * deep[0] + share[1] * deep[1] + share[2] * deep[2]
                                   : 1 / (share[0] / deep[0] + share[1] / deep[1] + share[2] / deep[2]);
    return at < depth - touching;
  }
  // Whether its face is beside a point that lies on these vertices: it has all of them; or some, with a ring; or neighbours, with two.
  bool beside(int64_t t, const int64_t *own) const {
    const int64_t *v = vertices.data() + 3 * t;
    int held = 0;
    for (int k = 0; k < 3; k++) held += own[k] == v[0] || own[k] == v[1] || own[k] == v[2];
    if (rings < 2 || held) return rings ? held > 0 : held == 3;
    if (own[0] < 0 || own[1] < 0 || own[2] < 0) return false;
    const int64_t *begin = edges.data(), *end = begin + edges.size();
    for (int k = 0; k < 3; k++)
      for (int j = 0; j < 3; j++)
        if (std::binary_search(begin, end, std::min(own[k], v[j]) * count + std::max(own[k], v[j]))) return true;
    return false;
  }
};

Out<bool> py_hidden(const nb::tuple &tables, double cell, int bits, const nb::tuple &triangles, double seam, double touching, bool orthographic,
                    int rings, nb::object pixels, nb::object depths, nb::object own) {
  const Index index(tables, cell, bits);
  require(triangles.size() == 6, "triangles must be those of boxes, corners, depths, vertices, edges and the count of vertices");
  const Triangles scene = {In<int64_t>(triangles[0]),
                           In<double>(triangles[1]),
                           In<double>(triangles[2]),
                           In<int64_t>(triangles[3]),
                           In<int64_t>(triangles[4]),
                           nb::cast<int64_t>(triangles[5]),
                           rings,
                           seam,
                           touching,
                           orthographic};
  const In<double> places(pixels), deep(depths);
  const In<int64_t> on(own);
  const size_t T = scene.vertices.shape(0), Q = deep.size();
  require(index.axes() == 2 && has_shape(places, {Q, 2}), "points must be in a picture, of shape (Q, 2)");
  require(has_shape(scene.of_box, {index.lows.shape(0)}) && has_shape(scene.corners, {T, 3, 2}) && has_shape(scene.depths, {T, 3}) &&
              has_shape(scene.vertices, {T, 3}) && (!on.given() || has_shape(on, {Q, 3})),
          "corners must have shape (T, 3, 2), depths and vertices (T, 3), own (Q, 3)");
  for (size_t k = 0; k < scene.of_box.size(); k++) require(uint64_t(scene.of_box.data()[k]) < T, "a box must be of a triangle");
  Buffer<bool> out(Q);
  {
    nb::gil_scoped_release nogil;
    for (size_t q = 0; q < Q; q++) {
      const double *p = places.data() + 2 * q;
      out.get()[q] = false;
      index.visit<2>(p, p, [&](int64_t box) {
        const int64_t t = scene.of_box.data()[box];
        return out.get()[q] = scene.before(t, p, deep.data()[q]) && !(on.given() && scene.beside(t, on.data() + 3 * q));
      });
    }
  }
  return array(std::move(out), {Q});
}

// For each point the nearest triangle within the tolerance or -1, the barycentric coordinates of its closest point, and that point.
nb::tuple py_nearest(const nb::tuple &tables, double cell, int bits, nb::object of_box, nb::object corners, double tolerance, nb::object points) {
  const Index index(tables, cell, bits);
  const In<int64_t> triangle(of_box);
  const In<double> corner(corners), places(points);
  const size_t T = corner.shape(0), Q = places.shape(0);
  require(index.axes() == 3 && has_shape(places, {Q, 3}) && has_shape(corner, {T, 3, 3}), "points must have shape (Q, 3), corners (T, 3, 3)");
  require(has_shape(triangle, {index.lows.shape(0)}), "a triangle a box must be given");
  for (size_t k = 0; k < triangle.size(); k++) require(uint64_t(triangle.data()[k]) < T, "a box must be of a triangle");
  Buffer<int64_t> nearest(Q);
  Buffer<double> shares(3 * Q), found(3 * Q);
  {
    nb::gil_scoped_release nogil;
    for (size_t q = 0; q < Q; q++) {
      const Vector p(places.data() + 3 * q);
      double best = tolerance, share[3], *own = shares.get() + 3 * q, *at = found.get() + 3 * q;
      nearest.get()[q] = -1;
      for (int d = 0; d < 3; d++) own[d] = 0, at[d] = places.data()[3 * q + d];
      index.visit<3>(places.data() + 3 * q, places.data() + 3 * q, [&](int64_t box) {
        const int64_t t = triangle.data()[box];
        const double *c = corner.data() + 9 * t;
        closest_on_triangle(p, c, share);
        const Vector on = Vector(c) * share[0] + Vector(c + 3) * share[1] + Vector(c + 6) * share[2];
        const double distance = (p - on).length();
        // Of those that are as near the last one, as numpy has it.
        if (!(distance <= best)) return false;
        best = distance, nearest.get()[q] = t;
        for (int d = 0; d < 3; d++) own[d] = share[d];
        at[0] = on.x, at[1] = on.y, at[2] = on.z;
        return false;
      });
    }
  }
  return nb::make_tuple(array(std::move(nearest), {Q}), array(std::move(shares), {Q, 3}), array(std::move(found), {Q, 3}));
}
}  // namespace

void bind(nb::module_ &m) {
  m.def("boxes_meeting", &py_meeting, "tables"_a, "cell"_a, "bits"_a, "low"_a, "high"_a, "first"_a, "most"_a);
  m.def("boxes_hidden", &py_hidden, "tables"_a, "cell"_a, "bits"_a, "triangles"_a, "seam"_a, "touching"_a, "orthographic"_a, "rings"_a, "pixels"_a,
        "depths"_a, "own"_a.none());
  m.def("boxes_nearest", &py_nearest, "tables"_a, "cell"_a, "bits"_a, "of_box"_a, "corners"_a, "tolerance"_a, "points"_a);
}
}  // namespace stroke::boxes
