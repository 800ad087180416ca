// The Python module diff3ds._kernels.
#include "cpu/areas/module.h"
#include "cpu/arrays.h"
#include "cpu/boxes/module.h"
#include "cpu/driver.h"
#include "cpu/edges/module.h"
#include "cpu/forms/module.h"
#include "cpu/project.h"
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>
#include <variant>
using namespace nb::literals;

namespace stroke {
namespace {
// Homogeneous cubics in pixels, or what gives them: control points, weights and the projections of the views.
using Projected = In<double>;
template <class S> struct Unprojected {
  In<S> points, weights;
  In<double> matrices;
};
template <class S> Unprojected<S> unprojected(const nb::tuple &curves) {
  require(curves.size() == 3, "curves must be cubics, or points, weights and matrices");
  return {In<S>(curves[0]), In<S>(curves[1]), In<double>(curves[2])};
}
// As render/kernel_inputs.py says: which segments make which stroke; both None where each is one.
struct ChainsIn {
  In<int64_t> first;
  In<bool> closed;
  Chains chains() const { return {first.data(), closed.data()}; }
  size_t strokes(size_t segments) const { return first.given() ? closed.shape(0) : segments; }
};
ChainsIn chains_of(const nb::object &chains, size_t segments) {
  if (chains.is_none()) return {};
  const nb::tuple both = nb::cast<nb::tuple>(chains);
  require(both.size() == 2, "chains must be first segments and closed, or None");
  ChainsIn out = {In<int64_t>(both[0]), In<bool>(both[1])};
  require(out.closed.ndim() == 1 && has_shape(out.first, {out.closed.shape(0) + 1}), "chains must have shapes (N + 1,) and (N,)");
  for (size_t n = 0; n <= out.closed.shape(0); n++)
    require(n ? out.first.data()[n] > out.first.data()[n - 1] : out.first.data()[0] == 0, "chains must have segments in order");
  require(size_t(out.first.data()[out.closed.shape(0)]) == segments, "chains must hold all segments");
  return out;
}
// As render/kernel_inputs.py says: which views, strokes and segments belong to which sketch; None for one sketch.
Layout layout_of(const In<int32_t> &batch, size_t views, size_t strokes, size_t segments) {
  Layout out = {int(views), int(strokes), int(segments), 0, nullptr};
  if (!batch.given()) return out;
  require(batch.ndim() == 2 && batch.shape(0) == 5 && batch.shape(1) > 1, "batch must have shape (5, sketches + 1)");
  out.sketches = int(batch.shape(1)) - 1, out.batch = batch.data();
  require(!out.first_view(0) && out.first_view(out.sketches) == int(views), "batch must hold all views");
  for (int b = 0; b < out.sketches; b++) require(out.first_view(b) < out.first_view(b + 1), "every sketch of a batch must have a view");
  for (Kind kind : {STROKES, SEGMENTS}) {
    require(!out.first(kind, 0) && out.first(kind, out.sketches) == out.count(kind) && !out.first_row(kind, 0), "batch must hold all strokes");
    for (int b = 0; b < out.sketches; b++) {
      const int count = out.first(kind, b + 1) - out.first(kind, b), seen = out.first_view(b + 1) - out.first_view(b);
      require(count >= 0 && int64_t(count) * seen == int64_t(out.first_row(kind, b + 1)) - out.first_row(kind, b), "batch must count rows");
    }
  }
  return out;
}
// As render/kernel_inputs.py says.
template <class S> struct Appearance {
  In<S> half_width, color, opacity, background;
  In<double> square;
};
template <class S> Appearance<S> appearance_of(const nb::tuple &appearance) {
  require(appearance.size() == 5, "appearance must be half widths, colours, opacities, the background and squares");
  return {In<S>(appearance[0]), In<S>(appearance[1]), In<S>(appearance[2]), In<S>(appearance[3]), In<double>(appearance[4])};
}
using Size = std::tuple<int, int>;

// A state with the tensors that it points into.
template <class S> struct Owner {
  State<S> state;
  std::variant<Projected, Unprojected<S>> curves;
  ChainsIn chains;
  In<int32_t> batch;
  Buffer<double> projections;  // the cubics of curves that came unprojected
  Appearance<S> appearance;
};

template <class S> Scene<S> scene(const Unprojected<S> &curves, const ChainsIn &chains, const In<int32_t> &batch) {
  const auto &[points, weights, matrices] = curves;
  require(points.ndim() == 3 && points.shape(2) == 3 && points.shape(1) >= 2 && points.shape(1) <= 4, "points must have shape (N, 2 to 4, 3)");
  require(has_shape(weights, {points.shape(0), points.shape(1)}), "weights must have shape (N, K)");
  require(matrices.ndim() == 3 && matrices.shape(1) == 4 && matrices.shape(2) == 4, "matrices must have shape (V, 4, 4)");
  require(matrices.shape(0) * points.shape(0) < (size_t(1) << 31), "too many views or strokes");
  const size_t segments = points.shape(0);
  return {layout_of(batch, matrices.shape(0), chains.strokes(segments), segments), int(points.shape(1)), points.data(), weights.data(),
          matrices.data()};
}

template <class S>
Input<S> input(const double *cubics, const Layout &layout, const ChainsIn &chains, const Appearance<S> &appearance, Size size,
               const Options &options) {
  const size_t V = layout.views, M = layout.segments, N = layout.strokes, rows = layout.rows(STROKES), segment_rows = layout.rows(SEGMENTS);
  const auto &[half_width, color, opacity, background, square] = appearance;
  const auto [height, width] = size;
  const size_t H = height, W = width;
  const bool along = half_width.ndim() == 3;
  // Those of a batch stand in one row, even if every view has its own.
  const bool good = layout.batch ? has_shape(half_width, {1, rows}) || has_shape(half_width, {1, segment_rows, 4})
                                 : has_shape(half_width, {V, N}) || has_shape(half_width, {V, M, 4});
  require(good || has_shape(half_width, {N}) || has_shape(half_width, {1, N}) || has_shape(half_width, {1, M, 4}),
          "half_width must have shape (N,), (1 or V, N) or (1 or V, M, 4), in a batch with a row's in place of a stroke's");
  const bool per_view = layout.batch ? half_width.size() != (along ? 4 * M : N) : half_width.ndim() > 1 && half_width.shape(0) == V && V > 1;
  require(has_shape(color, {N, 3}) && has_shape(opacity, {N}), "color and opacity must have shapes (N, 3) and (N,)");
  require(square.size() == 0 || has_shape(square, {V, 2, 2}), "squares must have shape (V, 2, 2), or none at all");
  // A background that is the same all along an axis may have one entry there.
  auto fits = [&b = background](int axis, size_t n) { return b.shape(axis) == n || b.shape(axis) == 1; };
  auto stride = [&b = background](int axis) -> ptrdiff_t {
    size_t n = 1;
    for (int k = axis + 1; k < 4; k++) n *= b.shape(k);
    return b.shape(axis) == 1 ? 0 : n;
  };
  require(height > 0 && width > 0 && background.ndim() == 4 && fits(0, V) && fits(1, H) && fits(2, W) && background.shape(3) == 3,
          "background must have shape (1 or V, 1 or H, 1 or W, 3)");
  require(segment_rows < (size_t(1) << 31) && V * ((H + TILE - 1) / TILE) * ((W + TILE - 1) / TILE) < (size_t(1) << 31),
          "too many views, strokes or pixels");
  require(options.blur >= 0 && options.near > 0 && options.strata >= 0 && options.strata <= 64, "blur, near or strata out of range");
  return {.layout = layout,
          .height = height,
          .width = width,
          .chains = chains.chains(),
          .cubics = cubics,
          .half_width = half_width.data(),
          .half_width_per_view = per_view,
          .half_width_along = along,
          .color = color.data(),
          .opacity = opacity.data(),
          .square = square.size() ? square.data() : nullptr,
          .background = background.data(),
          .background_view = stride(0),
          .background_row = stride(1),
          .background_pixel = stride(2),
          .options = options};
}

template <class S> nb::tuple draw(std::unique_ptr<Owner<S>> owner, const Scene<S> *unprojected, bool save) {
  const Input<S> &in = owner->state.input;
  const size_t V = in.layout.views, H = in.height, W = in.width;
  Images<S> images;
  {
    nb::gil_scoped_release nogil;
    std::lock_guard guard(threads().busy());
    if (unprojected) project(*unprojected, owner->projections.get());
    images = forward(owner->state, save);
  }
  nb::object kept = save ? nb::cast(std::move(owner)) : nb::none();
  return nb::make_tuple(array(std::move(images.color), {V, H, W, 3}), array(std::move(images.alpha), {V, H, W}),
                        array(std::move(images.depth), {V, H, W}), kept);
}
template <class S>
nb::tuple forward_of(const nb::tuple &curves, const nb::object &chains, const nb::object &batch, const nb::tuple &appearance, Size size,
                     const Options &options, bool save) {
  auto owner = std::make_unique<Owner<S>>();
  owner->appearance = appearance_of<S>(appearance);
  owner->batch = In<int32_t>(batch);
  if (curves.size() == 1) {
    const Projected cubics(curves[0]);
    require(cubics.ndim() == 4 && cubics.shape(2) == 4 && cubics.shape(3) == 4, "cubics must have shape (V, N, 4, 4)");
    owner->curves = cubics;
    owner->chains = chains_of(chains, cubics.shape(1));
    require(!owner->batch.given(), "sketches of a batch come unprojected");
    const Layout layout = layout_of({}, cubics.shape(0), owner->chains.strokes(cubics.shape(1)), cubics.shape(1));
    owner->state.input = input(cubics.data(), layout, owner->chains, owner->appearance, size, options);
    return draw<S>(std::move(owner), nullptr, save);
  }
  owner->curves = unprojected<S>(curves);
  const Unprojected<S> &given = std::get<Unprojected<S>>(owner->curves);
  owner->chains = chains_of(chains, given.points.shape(0));
  const Scene<S> s = scene(given, owner->chains, owner->batch);
  owner->projections = Buffer<double>(s.layout.rows(SEGMENTS) * 16);
  owner->state.input = input(owner->projections.get(), s.layout, owner->chains, owner->appearance, size, options);
  return draw<S>(std::move(owner), &s, save);
}
nb::tuple py_forward(const nb::tuple &curves, const nb::object &chains, const nb::object &batch, const nb::tuple &appearance, Size size,
                     const Options &options, bool save) {
  require(appearance.size() == 5, "appearance must be half widths, colours, opacities, the background and squares");
  return is_float32(appearance[1]) ? forward_of<float>(curves, chains, batch, appearance, size, options, save)
                                   : forward_of<double>(curves, chains, batch, appearance, size, options, save);
}

// Gradients of the appearance, and then of the curves as they were given.
template <class S>
nb::tuple py_backward(const Owner<S> &owner, const nb::tuple &upstream, const nb::tuple &planes, bool want_background, bool want_matrices) {
  require(upstream.size() == 3 && planes.size() == 2, "upstream must be three tensors or None, planes two");
  const In<S> g_color(upstream[0]), g_alpha(upstream[1]), g_depth(upstream[2]), alpha(planes[0]), depth(planes[1]);
  const Input<S> &in = owner.state.input;
  const size_t V = in.layout.views, N = in.layout.strokes, M = in.layout.segments, H = in.height, W = in.width;
  require(!g_color.given() || has_shape(g_color, {V, H, W, 3}), "the gradient of color must have shape (V, H, W, 3)");
  for (auto *a : {&g_alpha, &g_depth, &alpha, &depth}) require(!a->given() || has_shape(*a, {V, H, W}), "planes must have shape (V, H, W)");
  require(!g_depth.given() || (alpha.given() && depth.given()), "the gradient of depth needs alpha and depth");
  const auto *curves = std::get_if<Unprojected<S>>(&owner.curves);
  const Scene<S> s = curves ? scene(*curves, owner.chains, owner.batch) : Scene<S>{};
  const size_t K = s.controls;
  Gradients<S> g;
  Buffer<S> g_points(M * K * 3), g_weights(M * K);
  Buffer<double> g_matrices(V * 16);
  {
    nb::gil_scoped_release nogil;
    std::lock_guard guard(threads().busy());
    g = backward<S>(owner.state, {g_color.data(), g_alpha.data(), g_depth.data()}, alpha.data(), depth.data(), want_background);
    if (curves) project_backward(s, g.cubics.get(), g_points.get(), g_weights.get(), want_matrices ? g_matrices.get() : nullptr);
  }
  const In<S> &width = owner.appearance.half_width;
  auto g_half_width = width.ndim() == 1   ? array(std::move(g.half_width), {N})
                      : width.ndim() == 2 ? array(std::move(g.half_width), {width.shape(0), width.shape(1)})
                                          : array(std::move(g.half_width), {width.shape(0), width.shape(1), 4});
  auto g_colors = array(std::move(g.color), {N, 3}), g_opacity = array(std::move(g.opacity), {N});
  nb::object g_square = g.square.size() ? nb::cast(array(std::move(g.square), {V, 2, 2})) : nb::none();
  nb::object g_background = want_background ? nb::cast(array(std::move(g.background), {V, H, W, 3})) : nb::none();
  if (!curves) return nb::make_tuple(g_half_width, g_colors, g_opacity, g_background, g_square, array(std::move(g.cubics), {V, M, 4, 4}));
  nb::object of_matrices = want_matrices ? nb::cast(array(std::move(g_matrices), {V, 4, 4})) : nb::none();
  return nb::make_tuple(g_half_width, g_colors, g_opacity, g_background, g_square, array(std::move(g_points), {M, K, 3}),
                        array(std::move(g_weights), {M, K}), of_matrices);
}

// Projection alone and back, for tests: the drawing does both within its own calls.
template <class S> Out<double> project_of(const Unprojected<S> &curves) {
  const Scene<S> s = scene(curves, {}, {});
  Buffer<double> cubics(s.layout.rows(SEGMENTS) * 16);
  std::lock_guard guard(threads().busy());
  project(s, cubics.get());
  return array(std::move(cubics), {size_t(s.layout.views), size_t(s.layout.segments), 4, 4});
}
template <class S> nb::tuple project_backward_of(const Unprojected<S> &curves, const In<double> &g_cubics) {
  const Scene<S> s = scene(curves, {}, {});
  const size_t N = s.layout.segments, K = s.controls, V = s.layout.views;
  require(has_shape(g_cubics, {V, N, 4, 4}), "the gradient of cubics must have shape (V, N, 4, 4)");
  Buffer<S> g_points(N * K * 3), g_weights(N * K);
  Buffer<double> g_matrices(V * 16);
  std::lock_guard guard(threads().busy());
  project_backward(s, g_cubics.data(), g_points.get(), g_weights.get(), g_matrices.get());
  return nb::make_tuple(array(std::move(g_points), {N, K, 3}), array(std::move(g_weights), {N, K}), array(std::move(g_matrices), {V, 4, 4}));
}

Out<double> py_project(const nb::tuple &curves) {
  return is_float32(curves[0]) ? project_of(unprojected<float>(curves)) : project_of(unprojected<double>(curves));
}
nb::tuple py_project_backward(const nb::tuple &curves, nb::object g_cubics) {
  const In<double> g(g_cubics);
  return is_float32(curves[0]) ? project_backward_of(unprojected<float>(curves), g) : project_backward_of(unprojected<double>(curves), g);
}

template <class S> void bind(nb::module_ &m, const char *state) {
  nb::class_<Owner<S>>(m, state).def_prop_ro("fragments", [](const Owner<S> &o) { return o.state.fragments(); });
  m.def("backward", &py_backward<S>, "state"_a, "upstream"_a, "planes"_a, "want_background"_a, "want_matrices"_a);
}
}  // namespace
}  // namespace stroke

NB_MODULE(_kernels, m) {
  using namespace stroke;
  nb::set_leak_warnings(false);
  nb::exception<InvalidStroke>(m, "InvalidStroke", PyExc_ValueError);
  nb::class_<Options>(m, "Options")
      .def(
          "__init__",
          [](Options *self, bool world, bool orthographic, double near, double blur, int strata, uint64_t seed, double width_scale,
             bool differ_squares) {
            new (self) Options{.world = world,
                               .orthographic = orthographic,
                               .near = near,
                               .blur = blur,
                               .strata = strata,
                               .seed = seed,
                               .width_scale = width_scale,
                               .differ_squares = differ_squares};
          },
          nb::kw_only(), "world"_a, "orthographic"_a, "near"_a, "blur"_a, "strata"_a, "seed"_a, "width_scale"_a, "differ_squares"_a);
  bind<float>(m, "State32");
  bind<double>(m, "State64");
  m.def("forward", &py_forward, "curves"_a, "chains"_a.none(), "batch"_a.none(), "appearance"_a, "size"_a, "options"_a, "save"_a);
  m.def("project", &py_project, "curves"_a);
  m.def("project_backward", &py_project_backward, "curves"_a, "g_cubics"_a);
  areas::bind(m);
  boxes::bind(m);
  edges::bind(m);
  forms::bind(m);
  m.def("set_threads", &set_threads, nb::call_guard<nb::gil_scoped_release>());
  m.def("trim", [] { pool().trim(); });
  m.def("instruction_sets", &instruction_sets);
  m.def("instruction_set", &instruction_set);
  m.def("set_instruction_set", &set_instruction_set);
}
