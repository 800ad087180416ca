// The Python module diff3ds._kernels.
#include "driver.h"
#include "project.h"
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>
#include <variant>
namespace nb = nanobind;
using namespace nb::literals;

namespace stroke {
namespace {
template <class S> using In = nb::ndarray<const S, nb::c_contig, nb::device::cpu>;
template <class S> using Strided = nb::ndarray<const S, nb::ndim<4>, nb::device::cpu>;
template <class S> using Out = nb::ndarray<nb::numpy, S>;

template <class S> Out<S> array(Buffer<S> &&b, std::initializer_list<size_t> shape) {
  S *p = b.release();
  return Out<S>(p, shape, nb::capsule(p, [](void *q) noexcept { pool().give(q); }));
}
template <class T> bool has_shape(const T &a, std::initializer_list<size_t> shape) {
  if (a.ndim() != shape.size()) return false;
  size_t k = 0;
  for (size_t n : shape) if (a.shape(k++) != n) return false;
  return true;
}
void require(bool good, const char *what) { if (!good) throw std::invalid_argument(what); }

// Homogeneous cubics in pixels, or what gives them: control points, weights and the projections of the views.
using Projected = std::tuple<In<double>>;
template <class S> using Unprojected = std::tuple<In<S>, In<S>, In<double>>;
// Half widths, colours, opacities, background; and as render/drawing.py says: height and width, Options.
template <class S> using Looks = std::tuple<In<S>, In<S>, In<S>, Strided<S>>;
using Size = std::tuple<int, int>;
using Options = std::tuple<bool, double, double, int, uint64_t, double>;

// A state with the arrays that it points into.
template <class S> struct Owner {
  State<S> state;
  std::variant<Projected, Unprojected<S>> curves;
  Buffer<double> projections;  // the cubics of curves that came unprojected
  Looks<S> looks;
};

template <class S> Scene<S> scene(const Unprojected<S> &curves) {
  const auto &[points, weights, matrices] = curves;
  require(points.ndim() == 3 && points.shape(2) == 3 && points.shape(1) >= 2 && points.shape(1) <= 4, "points must have shape (N, 2 to 4, 3)");
  require(has_shape(weights, {points.shape(0), points.shape(1)}), "weights must have shape (N, K)");
  require(matrices.ndim() == 3 && matrices.shape(1) == 4 && matrices.shape(2) == 4, "matrices must have shape (V, 4, 4)");
  require(matrices.shape(0) * points.shape(0) < (size_t(1) << 31), "too many views or strokes");
  return {int(matrices.shape(0)), int(points.shape(0)), int(points.shape(1)), points.data(), weights.data(), matrices.data()};
}

template <class S> Input<S> input(const double *cubics, size_t V, size_t N, const Looks<S> &looks, Size size, Options options) {
  const auto &[half_width, color, opacity, background] = looks;
  const auto [height, width] = size;
  const auto [world, near, blur, strata, seed, width_scale] = options;
  const size_t H = height, W = width;
  require(has_shape(half_width, {N}) || has_shape(half_width, {1, N}) || has_shape(half_width, {V, N}), "half_width must have shape (N,) or (1 or V, N)");
  require(has_shape(color, {N, 3}) && has_shape(opacity, {N}), "color and opacity must have shapes (N, 3) and (N,)");
  // A background that is the same all along an axis may have one entry there.
  auto fits = [&b = background](int axis, size_t n) { return b.shape(axis) == n || b.shape(axis) == 1; };
  auto stride = [&b = background](int axis) { return b.shape(axis) == 1 ? 0 : b.stride(axis); };
  require(height > 0 && width > 0 && fits(0, V) && fits(1, H) && fits(2, W) && background.shape(3) == 3 && background.stride(3) == 1,
          "background must have shape (1 or V, 1 or H, 1 or W, 3)");
  require(V * N < (size_t(1) << 31) && V * ((H + TILE - 1) / TILE) * ((W + TILE - 1) / TILE) < (size_t(1) << 31), "too many views, strokes or pixels");
  require(blur >= 0 && near > 0 && strata >= 0 && strata <= 64, "blur, near or strata out of range");
  return {int(V), int(N), height, width, cubics, half_width.data(), half_width.ndim() == 2 && half_width.shape(0) == V && V > 1, S(width_scale),
          color.data(), opacity.data(), background.data(), stride(0), stride(1), stride(2), world, near, blur, strata, seed};
}

template <class S> nb::tuple draw(std::unique_ptr<Owner<S>> owner, const Scene<S> *unprojected, bool save) {
  const Input<S> &in = owner->state.input;
  const size_t V = in.views, H = in.height, W = in.width;
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
template <class S> nb::tuple forward_projected(Projected curves, Looks<S> looks, Size size, Options options, bool save) {
  const In<double> &cubics = std::get<0>(curves);
  require(cubics.ndim() == 4 && cubics.shape(2) == 4 && cubics.shape(3) == 4, "cubics must have shape (V, N, 4, 4)");
  auto owner = std::make_unique<Owner<S>>();
  owner->curves = curves, owner->looks = looks;
  owner->state.input = input(cubics.data(), cubics.shape(0), cubics.shape(1), looks, size, options);
  return draw<S>(std::move(owner), nullptr, save);
}
template <class S> nb::tuple forward_unprojected(Unprojected<S> curves, Looks<S> looks, Size size, Options options, bool save) {
  const Scene<S> s = scene<S>(curves);
  auto owner = std::make_unique<Owner<S>>();
  owner->projections = Buffer<double>(size_t(s.views) * s.strokes * 16);
  owner->curves = curves, owner->looks = looks;
  owner->state.input = input(owner->projections.get(), s.views, s.strokes, looks, size, options);
  return draw<S>(std::move(owner), &s, save);
}

// Gradients of the looks, and then of the curves as they were given.
template <class S>
nb::tuple py_backward(const Owner<S> &owner, std::optional<In<S>> g_color, std::optional<In<S>> g_alpha, std::optional<In<S>> g_depth,
                      std::optional<In<S>> alpha, std::optional<In<S>> depth, bool want_background, bool want_matrices) {
  const Input<S> &in = owner.state.input;
  const size_t V = in.views, N = in.strokes, H = in.height, W = in.width;
  require(!g_color || has_shape(*g_color, {V, H, W, 3}), "the gradient of color must have shape (V, H, W, 3)");
  for (auto *a : {&g_alpha, &g_depth, &alpha, &depth}) require(!*a || has_shape(**a, {V, H, W}), "planes must have shape (V, H, W)");
  require(!g_depth || (alpha && depth), "the gradient of depth needs alpha and depth");
  auto data = [](const std::optional<In<S>> &a) { return a ? a->data() : nullptr; };
  const auto *curves = std::get_if<Unprojected<S>>(&owner.curves);
  const Scene<S> s = curves ? scene<S>(*curves) : Scene<S>{};
  const size_t K = s.controls;
  Gradients<S> g;
  Buffer<S> g_points(N * K * 3), g_weights(N * K);
  Buffer<double> g_matrices(V * 16);
  {
    nb::gil_scoped_release nogil;
    std::lock_guard guard(threads().busy());
    g = backward<S>(owner.state, {data(g_color), data(g_alpha), data(g_depth)}, data(alpha), data(depth), want_background);
    if (curves) project_backward(s, g.cubics.get(), g_points.get(), g_weights.get(), want_matrices ? g_matrices.get() : nullptr);
  }
  const In<S> &width = std::get<0>(owner.looks);
  auto g_half_width = width.ndim() == 1 ? array(std::move(g.half_width), {N}) : array(std::move(g.half_width), {width.shape(0), N});
  auto g_colors = array(std::move(g.color), {N, 3}), g_opacity = array(std::move(g.opacity), {N});
  nb::object g_background = want_background ? nb::cast(array(std::move(g.background), {V, H, W, 3})) : nb::none();
  if (!curves) return nb::make_tuple(g_half_width, g_colors, g_opacity, g_background, array(std::move(g.cubics), {V, N, 4, 4}));
  nb::object of_matrices = want_matrices ? nb::cast(array(std::move(g_matrices), {V, 4, 4})) : nb::none();
  return nb::make_tuple(g_half_width, g_colors, g_opacity, g_background, array(std::move(g_points), {N, K, 3}), array(std::move(g_weights), {N, K}),
                        of_matrices);
}

// Projection alone and back, for tests: the drawing does both within its own calls.
template <class S> Out<double> py_project(Unprojected<S> curves) {
  const Scene<S> s = scene<S>(curves);
  Buffer<double> cubics(size_t(s.views) * s.strokes * 16);
  std::lock_guard guard(threads().busy());
  project(s, cubics.get());
  return array(std::move(cubics), {size_t(s.views), size_t(s.strokes), 4, 4});
}
template <class S> nb::tuple py_project_backward(Unprojected<S> curves, In<double> g_cubics) {
  const Scene<S> s = scene<S>(curves);
  const size_t N = s.strokes, K = s.controls, V = s.views;
  require(has_shape(g_cubics, {V, N, 4, 4}), "the gradient of cubics must have shape (V, N, 4, 4)");
  Buffer<S> g_points(N * K * 3), g_weights(N * K);
  Buffer<double> g_matrices(V * 16);
  std::lock_guard guard(threads().busy());
  project_backward(s, g_cubics.data(), g_points.get(), g_weights.get(), g_matrices.get());
  return nb::make_tuple(array(std::move(g_points), {N, K, 3}), array(std::move(g_weights), {N, K}), array(std::move(g_matrices), {V, 4, 4}));
}

template <class S> void bind(nb::module_ &m, const char *state) {
  nb::class_<Owner<S>>(m, state).def_prop_ro("fragments", [](const Owner<S> &o) { return o.state.fragments(); });
  // Arrays of another precision are for the other overload, not to be converted.
  auto exact = [](const char *name) { return nb::arg(name).noconvert(); };
  m.def("forward", &forward_unprojected<S>, exact("curves"), exact("looks"), "size"_a, "options"_a, "save"_a);
  m.def("forward", &forward_projected<S>, exact("curves"), exact("looks"), "size"_a, "options"_a, "save"_a);
  m.def("project", &py_project<S>, exact("curves"));
  m.def("project_backward", &py_project_backward<S>, exact("curves"), exact("g_cubics"));
  m.def("backward", &py_backward<S>, "state"_a, exact("g_color").none(), exact("g_alpha").none(), exact("g_depth").none(),
        exact("alpha").none(), exact("depth").none(), "want_background"_a, "want_matrices"_a);
}
}  // namespace
}  // namespace stroke

NB_MODULE(_kernels, m) {
  using namespace stroke;
  nb::set_leak_warnings(false);
  nb::exception<InvalidStroke>(m, "InvalidStroke", PyExc_ValueError);
  bind<float>(m, "State32");
  bind<double>(m, "State64");
  m.def("set_threads", &set_threads, nb::call_guard<nb::gil_scoped_release>());
  m.def("trim", [] { pool().trim(); });
  m.def("instruction_sets", &instruction_sets);
  m.def("instruction_set", &instruction_set);
  m.def("set_instruction_set", &set_instruction_set);
}
