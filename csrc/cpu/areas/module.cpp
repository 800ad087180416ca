#include "cpu/areas/module.h"
#include "cpu/areas/areas.h"
#include "cpu/arrays.h"
#include "cpu/threads.h"
#include <nanobind/stl/unique_ptr.h>
using namespace nb::literals;

namespace stroke::areas {
namespace {
// A state with the tensors that it points into.
template <class S> struct Owner {
  In<S> points, half_widths, transforms, axes, offsets, colors, background;
  In<int32_t> inner, contours, layers, paints;
  State<S> state;
};

// Shapes and indices have been checked in painted_layers.py.
template <class S>
std::unique_ptr<Owner<S>> owner_of(const nb::tuple &values, const nb::tuple &tables, nb::handle background, int width, int height) {
  require(values.size() == 6 && tables.size() == 4 && width > 0 && height > 0, "values must be six tensors, tables four, sizes positive");
  auto owner = std::make_unique<Owner<S>>(Owner<S>{In<S>(values[0]),
                                                   In<S>(values[1]),
                                                   In<S>(values[2]),
                                                   In<S>(values[3]),
                                                   In<S>(values[4]),
                                                   In<S>(values[5]),
                                                   In<S>(background),
                                                   In<int32_t>(tables[0]),
                                                   In<int32_t>(tables[1]),
                                                   In<int32_t>(tables[2]),
                                                   In<int32_t>(tables[3]),
                                                   {}});
  const auto &o = *owner;
  require(!o.background.given() || has_shape(o.background, {size_t(height), size_t(width), 4}), "background must have shape (H, W, 4)");
  owner->state = {{o.points.data(), o.half_widths.data(), o.transforms.data(), o.axes.data(), o.offsets.data(), o.colors.data(), o.inner.data(),
                   o.contours.data(), o.layers.data(), o.paints.data(), int(o.points.shape(0)), int(o.layers.shape(0)), int(o.transforms.shape(0)),
                   int(o.paints.shape(0)), int(o.colors.shape(0))},
                  width,
                  height,
                  o.background.given() ? o.background.data() : nullptr,
                  {}};
  return owner;
}
template <class S> nb::tuple draw_of(const nb::tuple &values, const nb::tuple &tables, nb::handle background, int width, int height, bool save) {
  auto owner = owner_of<S>(values, tables, background, width, height);
  Buffer<S> image;
  {
    nb::gil_scoped_release nogil;
    std::lock_guard guard(threads().busy());
    image = draw(owner->state, save);
  }
  nb::object kept = save ? nb::cast(std::move(owner)) : nb::none();
  return nb::make_tuple(array(std::move(image), {size_t(height), size_t(width), 4}), kept);
}
nb::tuple py_draw(const nb::tuple &values, const nb::tuple &tables, nb::object background, int width, int height, bool save) {
  require(values.size() == 6, "values must be six tensors");
  return is_float32(values[0]) ? draw_of<float>(values, tables, background, width, height, save)
                               : draw_of<double>(values, tables, background, width, height, save);
}

// Where the pixels of each layer begin in the next lists, and of these the pixels, by rows, and their shares.
template <class S> nb::tuple covered_of(const nb::tuple &values, const nb::tuple &tables, int width, int height) {
  auto owner = owner_of<S>(values, tables, nb::none(), width, height);
  Covered<S> found;
  {
    nb::gil_scoped_release nogil;
    std::lock_guard guard(threads().busy());
    cover(owner->state, false);
    found = covered(owner->state);
  }
  const size_t L = found.first.size(), P = found.pixels.size();
  return nb::make_tuple(array(std::move(found.first), {L}), array(std::move(found.pixels), {P}), array(std::move(found.shares), {P}));
}
nb::tuple py_covered(const nb::tuple &values, const nb::tuple &tables, int width, int height) {
  require(values.size() == 6, "values must be six tensors");
  return is_float32(values[0]) ? covered_of<float>(values, tables, width, height) : covered_of<double>(values, tables, width, height);
}

// Gradients of the values, and of the background.
template <class S> nb::tuple py_backward(const Owner<S> &owner, nb::object upstream, bool want_background) {
  const State<S> &state = owner.state;
  const size_t H = state.height, W = state.width;
  const In<S> g_image(upstream);
  require(has_shape(g_image, {H, W, 4}), "the gradient must have shape (H, W, 4)");
  Gradients<S> g;
  {
    nb::gil_scoped_release nogil;
    std::lock_guard guard(threads().busy());
    g = backward(state, g_image.data(), want_background);
  }
  const Tables<S> &t = state.tables;
  const size_t P = t.point_count, T = t.transform_count, Q = t.paint_count, M = t.stop_count;
  nb::object g_background = want_background ? nb::cast(array(std::move(g.background), {H, W, 4})) : nb::none();
  return nb::make_tuple(array(std::move(g.points), {P, 2}), array(std::move(g.half_widths), {P}), array(std::move(g.transforms), {T, 2, 3}),
                        array(std::move(g.axes), {Q, 4}), array(std::move(g.offsets), {M}), array(std::move(g.colors), {M, 4}), g_background);
}

template <class S> void bind_state(nb::module_ &m, const char *name) {
  nb::class_<Owner<S>>(m, name);
  m.def("areas_backward", &py_backward<S>, "state"_a, "upstream"_a, "want_background"_a);
}
}  // namespace

void bind(nb::module_ &m) {
  bind_state<float>(m, "Areas32");
  bind_state<double>(m, "Areas64");
  m.def("areas_draw", &py_draw, "values"_a, "tables"_a, "background"_a.none(), "width"_a, "height"_a, "save"_a);
  m.def("areas_covered", &py_covered, "values"_a, "tables"_a, "width"_a, "height"_a);
}
}  // namespace stroke::areas
