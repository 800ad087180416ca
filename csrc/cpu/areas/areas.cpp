#include "cpu/areas/areas.h"
#include "cpu/threads.h"
#include <algorithm>

namespace stroke::areas {
namespace {
template <class T> using Grown = std::vector<T>;

// The exact area of the layer in each pixel.
template <class S> void cover(Layer<S> &layer, int width, int height, bool save, Sweep<Grown> &sweep, std::vector<double> &sums) {
  Coverage<S> &out = layer.coverage;
  const Rows rows(layer.polygons, height);
  out.first = rows.first;
  out.runs.resize(rows.count);
  sums.assign(width + 2, 0);
  for (int k = 0; k < rows.count; k++) {
    auto &run = out.runs[k];
    run.borders = out.borders.size();
    const double top = rows.first + k;
    sweep.clear();
    for (int i = rows.begin[k]; i < rows.begin[k + 1]; i++) sweep.chain(layer.polygons.view(), rows.heads[i], top, top + 1);
    sweep.order(), sweep.slabs();
    Reach reach;
    sweep.borders(layer.rule, [&](const Border &border) {
      if (save) out.borders.push_back(border);
      reach.add(border), add_area(border, width, 0, sums.data());
    });
    run.left = reach.left(width), run.right = reach.right(width);
    run.start = out.shares.size();
    double sum = 0;
    for (int x = run.left; x < run.right; x++) {
      sum += sums[x];
      out.shares.push_back(S(clamp(sum, 0, 1)));
    }
    std::fill(sums.begin() + run.left, sums.begin() + run.right + 1, 0.0);
  }
}

template <class S> void start(const State<S> &state, int row, std::vector<Pixel> &pixels) {
  pixels.assign(state.width, Pixel{});
  if (!state.background) return;
  for (int x = 0; x < state.width; x++) {
    const S *b = state.background + 4 * (size_t(row) * state.width + x);
    for (int k = 0; k < 3; k++) pixels[x].straight[k] = pixels[x].color[k] = double(b[k]);
    pixels[x].alpha = double(b[3]), pixels[x].all = 1;
  }
}

template <class S, class Each> void paint_row(const State<S> &state, int row, std::vector<Pixel> &pixels, Each each) {
  for (size_t l = 0; l < state.layers.size(); l++) {
    const Layer<S> &layer = *state.layers[l];
    const auto *run = layer.coverage.at(row);
    if (!run) continue;
    const S *shares = layer.coverage.shares.data() + run->start - run->left;
    const bool plain = layer.paint.plain();
    Color color = layer.paint.color();
    for (int x = run->left; x < run->right; x++) {
      each(pixels[x]);
      if (shares[x] <= 0) continue;
      if (!plain) color = layer.paint.color(x, row);
      pixels[x].paint(double(shares[x]), color);
    }
  }
}

// Gradients of a row's pixels through all layers, from the top to the bottom: of coverages, in their order, and of paints.
template <class S> struct RowBack {
  const State<S> &state;
  const S *g_image;
  std::vector<std::vector<S>> &g_shares;       // as Coverage::shares, a layer
  std::vector<std::vector<double>> &g_paints;  // a layer: its rows, each with the paint's parameters
  S *g_background;

  void operator()(int row, std::vector<Pixel> &pixels, std::vector<Pixel> &states, std::vector<Pixel> &g) const {
    const int width = state.width;
    start(state, row, pixels);
    states.clear();
    paint_row(state, row, pixels, [&](const Pixel &p) { states.push_back(p); });
    g.assign(width, Pixel{});
    for (int x = 0; x < width; x++) {
      const S *up = g_image + 4 * (size_t(row) * width + x);
      for (int k = 0; k < 3; k++) g[x].straight[k] = double(up[k]);
      g[x].alpha = double(up[3]);
    }
    for (size_t l = state.layers.size(), left = states.size(); l-- > 0;) {
      const Layer<S> &layer = *state.layers[l];
      const auto *run = layer.coverage.at(row);
      if (!run) continue;
      left -= run->right - run->left;
      const Pixel *before = states.data() + left - run->left;
      const S *shares = layer.coverage.shares.data() + run->start - run->left;
      S *g_share = g_shares[l].data() + run->start - run->left;
      const bool plain = layer.paint.plain();
      double *g_paint = g_paints[l].data() + size_t(row - layer.coverage.first) * layer.paint.parameters();
      Color color = layer.paint.color();
      for (int x = run->left; x < run->right; x++) {
        if (!plain) color = layer.paint.color(x, row);
        const double share = double(shares[x]);
        Color g_color;
        g_share[x] = S(before[x].backward(share, color, g[x], g_color));
        if (share > 0) plain ? layer.paint.backward(g_color, g_paint) : layer.paint.backward(x, row, g_color, g_paint);
      }
    }
    if (!g_background) return;
    for (int x = 0; x < width; x++) {
      S *b = g_background + 4 * (size_t(row) * width + x);
      for (int k = 0; k < 3; k++) b[k] = S(g[x].straight[k] + g[x].color[k]);
      b[3] = S(g[x].alpha);
    }
  }
};

// The gradients of a layer's vertices.
template <class S> std::vector<double> back_to_vertices(const Layer<S> &layer, int width, const std::vector<S> &g_shares) {
  const Polygons polygons = layer.polygons.view();
  const Coverage<S> &coverage = layer.coverage;
  std::vector<double> g(2 * layer.polygons.vertices.size());
  for (size_t k = 0; k < coverage.runs.size(); k++) {
    const auto &run = coverage.runs[k];
    const size_t end = k + 1 < coverage.runs.size() ? coverage.runs[k + 1].borders : coverage.borders.size();
    for (size_t j = run.borders; j < end; j++) {
      const auto [upper, lower, sign] = polygons.downwards(coverage.borders[j].edge);
      back_to_ends(coverage.borders[j], polygons.vertices[upper], polygons.vertices[lower], width, run.left, g_shares.data() + run.start,
                   &g[2 * upper], &g[2 * lower]);
    }
  }
  return g;
}

template <class S> Buffer<S> narrowed(const std::vector<double> &sums) {
  Buffer<S> out(sums.size());
  for (size_t i = 0; i < sums.size(); i++) out[i] = S(sums[i]);
  return out;
}
}  // namespace

template <class S> void cover(State<S> &state, bool save) {
  const Tables<S> &t = state.tables;
  state.layers.resize(t.layer_count);
  threads().run(t.layer_count, 1, [&](int l, int) {
    static thread_local Sweep<Grown> sweep;
    static thread_local std::vector<double> sums;
    const int *row = t.layers + 5 * l;
    state.layers[l].reset(new Layer<S>{LayerPolygons(t, row), row[2], Paint<S>(t, row[4]), {}});
    cover(*state.layers[l], state.width, state.height, save, sweep, sums);
  });
}

template <class S> Covered<S> covered(const State<S> &state) {
  std::vector<int64_t> first = {0};
  for (const auto &layer : state.layers) {
    const auto &shares = layer->coverage.shares;
    first.push_back(first.back() + int64_t(std::count_if(shares.begin(), shares.end(), [](S share) { return share > 0; })));
  }
  Covered<S> out = {Buffer<int64_t>(first.size()), Buffer<int64_t>(size_t(first.back())), Buffer<S>(size_t(first.back()))};
  std::copy(first.begin(), first.end(), out.first.get());
  threads().run(int(state.layers.size()), 1, [&](int l, int) {
    const Coverage<S> &coverage = state.layers[l]->coverage;
    size_t at = size_t(first[l]);
    for (size_t k = 0; k < coverage.runs.size(); k++) {
      const auto &run = coverage.runs[k];
      const int64_t row = int64_t(coverage.first + int(k)) * state.width;
      const S *shares = coverage.shares.data() + run.start - run.left;
      for (int x = run.left; x < run.right; x++)
        if (shares[x] > 0) out.pixels[at] = row + x, out.shares[at++] = shares[x];
    }
  });
  return out;
}

template <class S> Buffer<S> draw(State<S> &state, bool save) {
  cover(state, save);
  Buffer<S> image(size_t(state.height) * state.width * 4);
  threads().run(state.height, 4, [&](int row, int) {
    static thread_local std::vector<Pixel> pixels;
    start(state, row, pixels);
    paint_row(state, row, pixels, [](const Pixel &) {});
    S *out = image.get() + size_t(row) * state.width * 4;
    for (int x = 0; x < state.width; x++, out += 4) {
      const Pixel &p = pixels[x];
      for (int k = 0; k < 3; k++) out[k] = S(p.straight[k]);
      out[3] = S(p.alpha);
    }
  });
  return image;
}

template <class S> Gradients<S> backward(const State<S> &state, const S *g_image, bool want_background) {
  const Tables<S> &t = state.tables;
  const int count = int(state.layers.size());
  std::vector<std::vector<S>> g_shares(count);
  std::vector<std::vector<double>> g_paints(count), g_controls(count), g_moves(count);
  for (int l = 0; l < count; l++) {
    const Layer<S> &layer = *state.layers[l];
    g_shares[l].resize(layer.coverage.shares.size());
    g_paints[l].assign(layer.coverage.runs.size() * layer.paint.parameters(), 0);
    g_controls[l].assign(12 * layer.polygons.segments.size(), 0), g_moves[l].assign(6, 0);
  }
  Gradients<S> out;
  out.background = Buffer<S>(want_background ? size_t(state.height) * state.width * 4 : 0);
  const RowBack<S> row_back = {state, g_image, g_shares, g_paints, want_background ? out.background.get() : nullptr};
  threads().run(state.height, 4, [&](int row, int) {
    static thread_local std::vector<Pixel> pixels, states, g;
    row_back(row, pixels, states, g);
  });
  threads().run(count, 1, [&](int l, int) {
    const Layer<S> &layer = *state.layers[l];
    const std::vector<double> g = back_to_vertices(layer, state.width, g_shares[l]);
    layer.polygons.backward(g.data(), g_controls[l].data(), g_moves[l].data());
  });
  // Sums in the order of layers and rows: the same for any number of threads.
  std::vector<double> points(2 * t.point_count), widths(t.point_count), transforms(6 * t.transform_count), axes(4 * t.paint_count),
      offsets(t.stop_count), colors(4 * t.stop_count);
  for (int l = 0; l < count; l++) {
    const Layer<S> &layer = *state.layers[l];
    for (size_t j = 0; j < layer.polygons.segments.size(); j++) {
      const Segment &s = layer.polygons.segments[j];
      for (int i = 0; i <= s.degree; i++) {
        const double *g = g_controls[l].data() + 12 * j + 3 * i;
        points[2 * s.index[i]] += g[0], points[2 * s.index[i] + 1] += g[1], widths[s.index[i]] += g[2];
      }
    }
    for (int k = 0; k < 6; k++) transforms[6 * t.layers[5 * l + 3] + k] += g_moves[l][k];
    const Paint<S> &paint = layer.paint;
    for (size_t row = 0; row < layer.coverage.runs.size(); row++) {
      const double *g = g_paints[l].data() + row * paint.parameters();
      if (paint.plain()) {
        for (int k = 0; k < 4; k++) colors[4 * paint.first + k] += g[k];
        continue;
      }
      for (int k = 0; k < 4 * paint.stops; k++) colors[4 * paint.first + k] += *g++;
      for (int k = 0; k < paint.stops; k++) offsets[paint.first + k] += *g++;
      for (int k = 0; k < 4; k++) axes[4 * paint.row + k] += *g++;
      for (int k = 0; k < 6; k++) transforms[6 * paint.transform + k] += *g++;
    }
  }
  out.points = narrowed<S>(points), out.half_widths = narrowed<S>(widths), out.transforms = narrowed<S>(transforms);
  out.axes = narrowed<S>(axes), out.offsets = narrowed<S>(offsets), out.colors = narrowed<S>(colors);
  return out;
}

template void cover(State<float> &, bool);
template void cover(State<double> &, bool);
template Covered<float> covered(const State<float> &);
template Covered<double> covered(const State<double> &);
template Buffer<float> draw(State<float> &, bool);
template Buffer<double> draw(State<double> &, bool);
template Gradients<float> backward(const State<float> &, const float *, bool);
template Gradients<double> backward(const State<double> &, const double *, bool);
}  // namespace stroke::areas
