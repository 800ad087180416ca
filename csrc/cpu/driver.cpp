// The driver: one call after the other of what makes images and gradients, threads over tiles, choice of instruction set.
#include "cpu/driver.h"
#include "cpu/bin.h"
#include "cpu/finish.h"
#include "cpu/outline.h"
#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace stroke {
#if defined(__x86_64__)
extern const Kernels<float> kernels_sse42, kernels_avx2, kernels_avx512;
#else
extern const Kernels<float> kernels_plain;
#endif
extern const Kernels<double> kernels_float64;

// Called by the kernels of every instruction set.
void *arena_take(Arena &a, size_t bytes) {
  bytes = (bytes + 127) / 64 * 64;
  if (a.chunks.empty() || a.used + bytes > a.chunks.back().size()) {
    a.chunks.emplace_back(bytes > Arena::CHUNK - 64 ? bytes : Arena::CHUNK - 64), a.used = 0;
  }
  a.used += bytes;
  return a.chunks.back().get() + a.used - bytes;
}

char *grow(Scratch &s, int index, size_t keep, size_t bytes) {
  Buffer<char> &block = s.blocks[index];
  if (bytes > block.size()) {
    Buffer<char> more(bytes);
    if (block.size()) std::memcpy(more.get(), block.get(), std::min(keep, block.size()));
    block = std::move(more);
  }
  return block.get();
}
void *work_memory(Scratch &s, size_t bytes) {
  if (s.work.size() < bytes) {
    s.work = Buffer<char>(bytes);
    std::memset(s.work.get(), 0, bytes);
  }
  return s.work.get();
}

namespace {
std::vector<const Kernels<float> *> usable_kernels() {
#if defined(__x86_64__)
  std::vector<const Kernels<float> *> found = {&kernels_sse42};
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2")) {
    found.push_back(&kernels_avx2);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512bw"))
      found.push_back(&kernels_avx512);
  }
  return found;
#else
  return {&kernels_plain};
#endif
}
const Kernels<float> *&float_kernels() {
  static const Kernels<float> *k = usable_kernels().back();
  return k;
}
template <class S> const Kernels<S> &kernels() {
  if constexpr (sizeof(S) == 4) return *float_kernels();
  else return kernels_float64;
}
// Scratch memory of each thread, by precision: kept between calls.
template <class S> std::vector<Scratch> &scratch() {
  static auto *s = new std::vector<Scratch>;
  if (int(s->size()) < threads().size()) s->resize(threads().size());
  return *s;
}
int grain(size_t n) { return std::clamp(int(n / (16 * threads().size())), 1, 8); }

template <class S> void prepare(State<S> &st) {
  const Input<S> &in = st.input;
  const Options &options = in.options;
  Job<S> &J = st.job;
  J.views = in.layout.views, J.height = in.height, J.width = in.width, J.world = options.world, J.along = in.half_width_along, J.oblong = in.square;
  J.tiles_x = (in.width + TILE - 1) / TILE, J.tiles_y = (in.height + TILE - 1) / TILE;
  const double sigma = std::sqrt(options.blur * options.blur + 1. / 12);
  J.filter = options.strata ? Filter<S>{S(0), S(0)} : options.blur > 0 ? Filter<S>{S(1 / sigma), S(BLUR_REACH * sigma)} : Filter<S>{S(0), S(.5)};
  J.min_depth = S(options.near / 2), J.chord_slack = S(2 * CHORD_TOL);
  J.strata = options.strata, J.seed = options.seed;
  J.background = in.background, J.background_view = in.background_view, J.background_row = in.background_row;
  J.background_pixel = in.background_pixel;
  const size_t count = in.layout.rows(STROKES), segments = in.layout.rows(SEGMENTS), chunks = (count + CHUNK - 1) / CHUNK;
  st.reach = Buffer<S>(count + 1), st.scale = Buffer<double>(segments + 1);
  st.piece_first = Buffer<uint32_t>(segments + 1), st.stroke_intersection_first = Buffer<uint32_t>(count + 1);
  std::vector<Part<S>> &parts = parts_of<S>(chunks);
  std::vector<std::unique_ptr<Binner>> binners(threads().size());
  threads().run(int(chunks), 1, [&](int k, int id) {
    if (!binners[id]) binners[id] = std::make_unique<Binner>(size_t(J.tiles_x) * J.tiles_y);
    Flattener flattener(in.height, in.width, options.strata > 0);
    for (size_t i = size_t(k) * CHUNK; i < std::min(count, size_t(k + 1) * CHUNK); i++) {
      Part<S> &part = parts[k];
      const size_t chords = part.flat.chords.size(), stroke_intersections = part.stroke_intersections.size();
      flatten_stroke(st, flattener, i, part);
      bin_stroke(st, i, uint32_t(chords), *binners[id], part);
      st.stroke_intersection_first[i + 1] = uint32_t(part.stroke_intersections.size() - stroke_intersections);
    }
  });
  join_parts(st, parts);
  add_up(st.piece_first, segments), add_up(st.stroke_intersection_first, count);
  sort_by_tile(st);
  J.pieces = st.flat.pieces.begin(), J.piece_stroke = st.piece_stroke.get();
  J.chords = st.flat.chords.begin(), J.chord_info = st.flat.chord_info.begin();
  J.intersections = st.intersections.get(), J.tile_first = st.tile_first.get(), J.reach = st.reach.get();
}

}  // namespace

void set_threads(int n) {
  std::lock_guard guard(threads().busy());
  threads().resize(std::clamp(n, 1, 256));
}
std::vector<std::string> instruction_sets() {
  std::vector<std::string> names;
  for (auto *k : usable_kernels()) names.push_back(k->isa);
  return names;
}
void set_instruction_set(const std::string &name) {
  for (auto *k : usable_kernels())
    if (name == k->isa) {
      std::lock_guard guard(threads().busy());
      float_kernels() = k, scratch<float>().clear();  // its arrays are counted in vectors
      return;
    }
  throw std::invalid_argument("this machine does not run the instruction set " + name);
}
std::string instruction_set() { return float_kernels()->isa; }

template <class S> size_t State<S>::fragments() const {
  size_t n = 0;
  for (size_t t = 0; t < tiles.size(); t++) n += tiles[t].fragments;
  return n;
}

template <class S> Images<S> forward(State<S> &st, bool save) {
  prepare(st);
  Job<S> &J = st.job;
  const size_t pixels = size_t(J.views) * J.height * J.width, tiles = size_t(J.views) * J.tiles_x * J.tiles_y;
  Images<S> images{Buffer<S>(3 * pixels), Buffer<S>(pixels), Buffer<S>(pixels)};
  J.color = images.color.get(), J.alpha = images.alpha.get(), J.depth = images.depth.get(), J.save = save;
  if (save) st.tiles = Buffer<Tile>(tiles * (J.strata ? J.strata * J.strata : 1));
  J.tiles = st.tiles.get();
  st.arenas.resize(threads().size());
  auto &memory = scratch<S>();
  threads().run(int(tiles), grain(tiles), [&](int t, int id) { kernels<S>().forward(J, t, memory[id], st.arenas[id]); }, J.tile_first);
  return images;
}

// From sums over the rows of each view, in their order.
template <class S> static Buffer<double> square_gradients(const Input<S> &in, const std::vector<double> &rows) {
  Buffer<double> out(4 * size_t(in.layout.views));
  std::vector<double> sums(out.size());
  for (size_t i = 0; i < rows.size(); i++) sums[4 * size_t(seen_in(in.layout, STROKES, i / 4).view) + i % 4] += rows[i];
  for (int v = 0; v < in.layout.views; v++) square_gradient(in.square_of(v), sums.data() + 4 * v, out.get() + 4 * v);
  return out;
}

template <class S> Gradients<S> backward(const State<S> &st, const Upstream<S> &up, const S *alpha, const S *depth, bool background) {
  const Input<S> &in = st.input;
  Job<S> J = st.job;
  const size_t tiles = size_t(J.views) * J.tiles_x * J.tiles_y;
  const size_t pixels = size_t(J.views) * J.height * J.width, pieces = st.flat.pieces.size();
  const Layout &layout = in.layout;
  const Kind with_width = in.half_width_along ? SEGMENTS : STROKES;
  const size_t widths = (in.half_width_per_view ? layout.rows(with_width) : layout.count(with_width)) * (in.half_width_along ? 4 : 1);
  Gradients<S> out{
      Buffer<double>(16 * layout.rows(SEGMENTS)), {}, Buffer<S>(widths), Buffer<S>(3 * size_t(layout.strokes)), Buffer<S>(layout.strokes),
      Buffer<S>(background ? 3 * pixels : 0)};
  Buffer<S> slots(size_t(st.intersections[st.stroke_intersections.size()].slot) * NGRAD), outline_sums(J.strata ? pieces * NSUMS : 0);
  const size_t squares = in.square && in.options.differ_squares ? 4 * layout.rows(STROKES) : 0;  // of each row
  Buffer<S> square_slots(squares ? size_t(st.intersections[st.stroke_intersections.size()].slot) * 4 : 0);
  std::vector<double> square_rows(squares);
  J.g_color = up.color, J.g_alpha = up.alpha, J.g_depth = up.depth, J.g_slot = slots.get(), J.g_square = squares ? square_slots.get() : nullptr;
  J.g_background = background ? out.background.get() : nullptr;
  J.alpha = const_cast<S *>(alpha), J.depth = const_cast<S *>(depth);
  auto &memory = scratch<S>();
  threads().run(int(tiles), grain(tiles), [&](int t, int id) { kernels<S>().backward(J, t, memory[id]); }, J.tile_first);
  if (J.strata) {
    Outlines<S> outlines = sample_outlines(st);
    J.outline = outlines.points.get(), J.outline_order = outlines.order.get(), J.outline_first = outlines.tile_first.get();
    J.g_outline = outlines.gradient.get();
    threads().run(int(tiles), grain(tiles), [&](int t, int id) { kernels<S>().outline_tile(J, t, memory[id]); });
    threads().run(int(pieces), 8, [&](int p, int) {
      kernels<S>().outline_piece(J, p, outlines.piece_first[p], outlines.piece_first[p + 1], outline_sums.get() + size_t(p) * NSUMS);
    });
  }
  const S scale = S(in.options.width_scale);
  threads().run(layout.strokes, 16, [&](int n, int) {
    const int first = in.chains.first_of(n), segments = in.chains.first_of(n + 1) - first;
    const Rows stroke = rows_of(layout, STROKES, n), segment = rows_of(layout, SEGMENTS, first);
    const size_t widths = in.half_width_along ? 4 * size_t(segments) : 0;
    Appearance total;
    total.widths.resize(widths);
    auto put_widths = [&](const Appearance &sums, size_t stroke, size_t segment) {
      if (!in.half_width_along) out.half_width[stroke] = scale * S(sums.half_width);
      for (size_t k = 0; k < widths; k++) out.half_width[4 * segment + k] = scale * S(sums.widths[k]);
    };
    for (int v = stroke.first_view; v < stroke.end_view; v++) {
      Appearance one;
      one.widths.resize(widths);
      finish_view(st, J, J.strata ? outline_sums.get() : nullptr, stroke.at(v), segment.at(v), segments, out.cubics.get(), one);
      for (size_t k = 0; squares && k < 4; k++) square_rows[4 * size_t(stroke.at(v)) + k] = one.square[k];
      if (in.half_width_per_view) put_widths(one, stroke.at(v), segment.at(v));
      total.half_width += one.half_width, total.opacity += one.opacity;
      for (int k = 0; k < 3; k++) total.color[k] += one.color[k];
      for (size_t k = 0; k < widths; k++) total.widths[k] += one.widths[k];
    }
    if (!in.half_width_per_view) put_widths(total, n, first);
    out.opacity[n] = S(total.opacity);
    for (int k = 0; k < 3; k++) out.color[3 * n + k] = S(total.color[k]);
  });
  if (squares) out.square = square_gradients(in, square_rows);
  return out;
}

template struct State<float>;
template struct State<double>;
template Images<float> forward(State<float> &, bool);
template Images<double> forward(State<double> &, bool);
template Gradients<float> backward(const State<float> &, const Upstream<float> &, const float *, const float *, bool);
template Gradients<double> backward(const State<double> &, const Upstream<double> &, const double *, const double *, bool);
}  // namespace stroke
