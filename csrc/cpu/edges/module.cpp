// Cells of space and points on edges that views confirm, and lines that appear beside others.
#include "cpu/edges/module.h"
#include "cpu/edges/crowd.h"
#include "cpu/edges/cut.h"
#include "cpu/edges/settle.h"
#include "cpu/edges/views.h"
#include "cpu/threads.h"
#include <nanobind/stl/array.h>
using namespace nb::literals;

namespace stroke::edges {
namespace {
// Which cells of space a ridge passes in how many views.
struct Cells {
  Views<float> views;
  In<double> reach, centers;  // (V,), squares of pixels times world units: as far from a centre at depth 1 a ridge passes its cell; (M, 3)

  Cells(const nb::tuple &tables, nb::object reach, nb::object cells) : views(tables), reach(reach), centers(cells) {
    require(has_shape(this->reach, {views.count()}) && has_shape(centers, {count(), 3}), "reach must have shape (V,), cells (M, 3)");
  }
  size_t count() const { return centers.shape(0); }
  // f(view, cell, match) of the cells that are not done, block after block of them and view after view, so that a processor works on several at once.
  template <class Done, class F> void visit(Done &&done, F &&f) const {
    constexpr size_t BLOCK = 64;
    float x[3][BLOCK] = {}, column[BLOCK], row[BLOCK], depth[BLOCK];
    for (size_t first = 0; first < count(); first += BLOCK) {
      const size_t size = std::min(BLOCK, count() - first);
      for (size_t k = 0; k < size; k++)
        for (int d = 0; d < 3; d++) x[d][k] = float(centers.data()[3 * (first + k) + d]);
      for (size_t view = 0; view < views.count(); view++) {
        const float *p = views.projection.data() + 12 * view;
        for (size_t k = 0; k < BLOCK; k++) {
          depth[k] = p[8] * x[0][k] + p[9] * x[1][k] + p[10] * x[2][k] + p[11];
          const float by = depth[k] == 0 ? 1e-12f : depth[k];
          column[k] = (p[0] * x[0][k] + p[1] * x[1][k] + p[2] * x[2][k] + p[3]) / by;
          row[k] = (p[4] * x[0][k] + p[5] * x[1][k] + p[6] * x[2][k] + p[7]) / by;
        }
        bool left = false;
        for (size_t k = 0; k < size; k++) {
          if (done(view, first + k)) continue;
          left = true;
          Views<float>::Match at;
          at.column = column[k], at.row = row[k], at.depth = depth[k];
          f(view, first + k, views.matched(view, at));
        }
        if (!left) break;
      }
    }
  }
  bool passed(size_t view, const Views<float>::Match &match) const {
    const float depth = std::max(match.depth, 1e-9f);
    return match.ridge >= 0 && match.square * (depth * depth) < reach.data()[view];
  }
};

// Whether so many views have a ridge that passes a cell.
Out<bool> py_confirmed(const nb::tuple &tables, nb::object reach, nb::object centers, int least) {
  const Cells cells(tables, reach, centers);
  const size_t M = cells.count();
  const int V = int(cells.views.count());
  Buffer<bool> out(M);
  {
    nb::gil_scoped_release nogil;
    std::vector<int> missing(M, least);
    // Until it is known.
    cells.visit([&](size_t view, size_t cell) { return missing[cell] <= 0 || missing[cell] > V - int(view); },
                [&](size_t view, size_t cell, const auto &match) { missing[cell] -= cells.passed(view, match); });
    for (size_t cell = 0; cell < M; cell++) out.get()[cell] = missing[cell] <= 0;
  }
  return array(std::move(out), {M});
}

// For each cell the sum over views of what it says at the pixel where the cell appears that no ridge passes it, or that one does.
Out<float> py_odds(const nb::tuple &tables, nb::object reach, nb::object centers, nb::object said) {
  const Cells cells(tables, reach, centers);
  const In<float> says(said);
  const size_t M = cells.count(), V = cells.views.count(), P = cells.views.pixels();
  require(has_shape(says, {V, P, 2}), "what is said must have shape (V, H * W, 2)");
  Buffer<float> out(M);
  {
    nb::gil_scoped_release nogil;
    std::fill_n(out.get(), M, 0.0f);
    cells.visit([](size_t, size_t) { return false; },
                [&](size_t view, size_t cell, const auto &match) {
                  if (match.ridge >= 0) out.get()[cell] += says.data()[2 * (view * P + match.pixel) + cells.passed(view, match)];
                });
  }
  return array(std::move(out), {M});
}

// Points moved onto the edges near them, the directions of these, and sums of the weights of what views show; see Settling.
nb::tuple py_settled(const nb::tuple &tables, nb::object planes, nb::object points, nb::object directions, double sigma, double within, double tilt,
                     int rounds, double damping, double longest) {
  const Views<double> views(tables);
  const In<double> plane(planes), point(points), known(directions);
  const size_t M = point.shape(0);
  require(has_shape(plane, {views.ridges.shape(1), 4}) && has_shape(point, {M, 3}) && (!known.given() || has_shape(known, {M, 3})),
          "planes must have shape (R, 4), points and directions (M, 3)");
  const Settling settling = {sigma, within, tilt, damping, longest, rounds, known.given()};
  Buffer<double> out(3 * M), axis(3 * M), score(M);
  std::copy_n(point.data(), 3 * M, out.get());
  if (known.given()) std::copy_n(known.data(), 3 * M, axis.get());
  {
    nb::gil_scoped_release nogil;
    std::vector<Settling::Plane> near;
    for (size_t k = 0; k < M; k++) score.get()[k] = settling.step(views, plane.data(), out.get() + 3 * k, axis.get() + 3 * k, near);
  }
  return nb::make_tuple(array(std::move(out), {M, 3}), array(std::move(axis), {M, 3}), array(std::move(score), {M}));
}

// In which views points lie so near to a ridge, which runs along a line through them to some sine.
Out<bool> py_shown(const nb::tuple &tables, nb::object normals, nb::object points, nb::object ahead, double within, double slant) {
  const Views<double> views(tables);
  const In<double> normal(normals), here(points), there(ahead);
  const size_t M = here.shape(0), V = views.count();
  require(has_shape(normal, {views.ridges.shape(1), 2}) && has_shape(here, {M, 3}) && has_shape(there, {M, 3}),
          "normals must have shape (R, 2), points and those ahead of them (M, 3)");
  Buffer<bool> out(V * M);
  {
    nb::gil_scoped_release nogil;
    for (size_t view = 0; view < V; view++)
      for (size_t k = 0; k < M; k++) {
        const auto match = views.match(view, here.data() + 3 * k);
        bool &shown = out.get()[view * M + k] = match.ridge >= 0 && match.square < within * within;
        if (!shown) continue;
        const auto ahead = views.project(view, there.data() + 3 * k);
        const double *n = normal.data() + 2 * match.ridge, x = ahead.column - match.column, y = ahead.row - match.row;
        // Of a line seen from its end nothing says how it runs.
        shown = std::abs(x * n[0] + y * n[1]) / (std::sqrt(x * x + y * y) + 1e-12) < slant;
      }
  }
  return array(std::move(out), {V, M});
}

// Where a row of points is cut, of the places where it may be: see Cutting.
Out<int64_t> py_cut(nb::object points, nb::object places, double scatter, double stray, double rise, std::array<double, 3> prices,
                    std::array<double, 3> arcs, double settled, double even, int circle_rounds, int cubic_rounds) {
  const In<double> point(points);
  const In<int64_t> place(places);
  const size_t count = place.size();
  require(has_shape(point, {point.shape(0), 3}) && count > 0, "points must have shape (M, 3)");
  for (size_t k = 0; k < count; k++)
    require(uint64_t(place.data()[k]) < point.shape(0) && (!k || place.data()[k - 1] < place.data()[k]), "places must be of points, and rise");
  const Cutting cutting = {scatter, stray,   rise,    prices[0], prices[1],     prices[2],   arcs[0],
                           arcs[1], arcs[2], settled, even,      circle_rounds, cubic_rounds};
  Buffer<int64_t> out(count);
  {
    nb::gil_scoped_release nogil;
    const std::vector<int64_t> last = cutting.cut(point.data(), place.data(), count);
    std::copy(last.begin(), last.end(), out.get());
  }
  return array(std::move(out), {count});
}

// Which of the points that are asked for another one appears beside, of those that count as such; see Crowd.
Out<bool> py_crowded(nb::object asked, nb::object by, nb::object pixels, nb::object headings, nb::object places, nb::object tangents, double side,
                     double slant, double apart) {
  const In<bool> here(asked), there(by);
  const In<double> pixel(pixels), heading(headings), place(places), along(tangents);
  const size_t M = here.size();
  require(has_shape(here, {M}) && has_shape(there, {M}) && has_shape(pixel, {2, M}) && has_shape(heading, {2, M}) && has_shape(place, {3, M}) &&
              has_shape(along, {3, M}) && side > 0,
          "asked and by must have shape (M,), pixels and headings (2, M), places and tangents (3, M)");
  Buffer<bool> out(M);
  {
    nb::gil_scoped_release nogil;
    const auto point = [&](size_t k) {
      Point p;
      for (int d = 0; d < 2; d++) p.pixel[d] = pixel.data()[d * M + k], p.heading[d] = heading.data()[d * M + k];
      for (int d = 0; d < 3; d++) p.place[d] = place.data()[d * M + k], p.along[d] = along.data()[d * M + k];
      p.number = int64_t(k);
      return p;
    };
    std::vector<Point> others;
    for (size_t k = 0; k < M; k++)
      if (there.data()[k]) others.push_back(point(k));
    const Crowd crowd(others, side, slant, apart);
    for (size_t k = 0; k < M; k++) out.get()[k] = here.data()[k] && crowd.beside(point(k));
  }
  return array(std::move(out), {M});
}

// How far drawn images are from bytes of some of the views: sums of squares of each, and what the mean of these wants of each pixel.
nb::tuple py_missed(nb::object images, nb::object wanted, nb::object views) {
  const In<float> image(images);
  const In<uint8_t> want(wanted);
  const In<int64_t> view(views);
  require(image.ndim() == 3 && want.ndim() == 3, "images and bytes must have shape (B, H, W) and (V, H, W)");
  const size_t B = image.shape(0), H = image.shape(1), W = image.shape(2), V = want.shape(0);
  require(has_shape(view, {B}) && has_shape(want, {V, H, W}), "images, bytes and views must have shape (B, H, W), (V, H, W) and (B,)");
  for (size_t k = 0; k < B; k++) require(uint64_t(view.data()[k]) < V, "views must be of those wanted");
  float values[256];
  for (int byte = 0; byte < 256; byte++) values[byte] = float(byte) / 255;
  Buffer<double> sums(B);
  Buffer<float> gradient(B * H * W);
  {
    nb::gil_scoped_release nogil;
    std::lock_guard busy(threads().busy());
    const float share = 1 / float(B);
    threads().run(int(B), 1, [&](int k, int) {
      const float *drawn = image.data() + k * H * W;
      const uint8_t *bytes = want.data() + view.data()[k] * H * W;
      float *out = gradient.get() + k * H * W;
      double sum = 0;
      for (size_t pixel = 0; pixel < H * W; pixel++) {
        const float off = drawn[pixel] - values[bytes[pixel]];
        sum += double(off) * off, out[pixel] = share * (2 * off);
      }
      sums.get()[k] = sum;
    });
  }
  return nb::make_tuple(array(std::move(sums), {B}), array(std::move(gradient), {B, H, W}));
}
}  // namespace

void bind(nb::module_ &m) {
  m.def("edges_confirmed", &py_confirmed, "tables"_a, "reach"_a, "centers"_a, "least"_a);
  m.def("edges_odds", &py_odds, "tables"_a, "reach"_a, "centers"_a, "said"_a);
  m.def("edges_settled", &py_settled, "tables"_a, "planes"_a, "points"_a, "directions"_a.none(), "sigma"_a, "within"_a, "tilt"_a, "rounds"_a,
        "damping"_a, "longest"_a);
  m.def("edges_cut", &py_cut, "points"_a, "places"_a, "scatter"_a, "stray"_a, "rise"_a, "prices"_a, "arcs"_a, "settled"_a, "even"_a,
        "circle_rounds"_a, "cubic_rounds"_a);
  m.def("edges_missed", &py_missed, "images"_a, "wanted"_a, "views"_a);
  m.def("edges_shown", &py_shown, "tables"_a, "normals"_a, "points"_a, "ahead"_a, "within"_a, "slant"_a);
  m.def("edges_crowded", &py_crowded, "asked"_a, "by"_a, "pixels"_a, "headings"_a, "places"_a, "tangents"_a, "side"_a, "slant"_a, "apart"_a);
}
}  // namespace stroke::edges
