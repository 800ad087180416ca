// The driver: flattening and binning of strokes, threads over tiles, choice of instruction set.
#include "driver.h"
#include "touch.h"
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

constexpr int CHUNK = 16;  // strokes flattened at a time

// What one thread needs to flatten strokes.
struct Binner {
  Buffer<uint32_t> mark;       // per tile: 1 + its touch of the current stroke
  explicit Binner(size_t tiles) : mark(tiles) { std::fill_n(mark.get(), tiles, 0); }
};

// What a chunk of strokes leaves, with indices of its own.
template <class S> struct Part {
  Flat<S> flat;
  List<typename State<S>::Touch> touches;
  void clear() {
    flat.pieces.shorten(0), flat.piece_info.shorten(0), flat.chords.shorten(0), flat.chord_info.shorten(0), flat.tangents.shorten(0);
    touches.shorten(0);
  }
};

// Parts of the last calls, for their memory.
template <class S> std::vector<Part<S>> &parts_of(size_t chunks) {
  static auto *parts = new std::vector<Part<S>>;
  if (parts->size() < chunks) parts->resize(chunks);
  for (auto &p : *parts) p.clear();
  return *parts;
}
template <class S> void check(const Input<S> &in, size_t i, const double *cubic, double half_width, const S *color, double opacity) {
  if (drawable(cubic, half_width, color, opacity)) return;
  throw InvalidStroke("stroke " + std::to_string(i % in.strokes) + " in view " + std::to_string(i / in.strokes));
}

template <class S> void flatten_stroke(State<S> &st, Flattener &flattener, size_t i, Part<S> &part) {
  const Input<S> &in = st.input;
  const size_t n = i % in.strokes;
  const S half_width = in.width_scale * in.half_width[in.half_width_per_view ? i : n];
  check(in, i, in.cubics + 16 * i, half_width, in.color + 3 * n, in.opacity[n]);
  double cubic[16], largest = 0;
  for (int k = 3; k < 16; k += 4) largest = std::max(largest, in.cubics[16 * i + k]);
  st.scale[i] = 1 / largest;
  for (int k = 0; k < 16; k++) cubic[k] = in.cubics[16 * i + k] * st.scale[i];
  const double reach = reach_of(cubic, half_width, in.world, in.near, st.job.filter.reach, in.width, in.height);
  st.reach[i] = S(reach);
  Piece<S> look{};
  look.half_width = half_width, look.opacity = in.opacity[n];
  for (int k = 0; k < 3; k++) look.color[k] = in.color[3 * n + k];
  flattener.add(part.flat, cubic, in.near, reach, uint32_t(i), look);
}

// Touches of the stroke whose chords start at `first`: for every tile the range of chords that may reach it.
template <class S> void bin_stroke(const State<S> &st, size_t i, uint32_t first_chord, Binner &binner, Part<S> &part) {
  const Job<S> &J = st.job;
  const float R = float(st.reach[i]);
  const uint32_t first_tile = uint32_t(i / J.strokes) * J.tiles_x * J.tiles_y, first_touch = uint32_t(part.touches.size());
  for (uint32_t s = first_chord; s < part.flat.chords.size(); s++)
    visit_tiles(part.flat.chords[s], part.flat.chord_info[s].length, R, J.strata > 0, J.tiles_x, J.tiles_y, [&](int tx, int ty) {
      uint32_t &mark = binner.mark[ty * J.tiles_x + tx];
      if (!mark) {
        part.touches.add({first_tile + uint32_t(ty * J.tiles_x + tx), uint32_t(i), s, s, 0, 0, 0, false});
        mark = uint32_t(part.touches.size());
      }
      part.touches[mark - 1].last = s;
    });
  for (uint32_t k = first_touch; k < part.touches.size(); k++) {
    auto &t = part.touches[k];
    const ChordInfo &a = part.flat.chord_info[t.first], &b = part.flat.chord_info[t.last];
    t.piece = a.piece, t.pieces = b.piece - a.piece + 1, t.smooth = smooth(a, b);
    binner.mark[t.tile - first_tile] = 0;
  }
}

// From counts behind each index to the first of each.
void add_up(Buffer<uint32_t> &first, size_t count) {
  first[0] = 0;
  for (size_t i = 0; i < count; i++) first[i + 1] += first[i];
}

// Joins the parts of all chunks in order: results do not depend on which thread did what.
template <class S> void join_parts(State<S> &st, const std::vector<Part<S>> &parts) {
  Flat<S> &flat = st.flat;
  struct Start { uint32_t chord, piece, touch; };
  std::vector<Start> starts;
  size_t chords = 0, pieces = 0, touches = 0, tangents = 0;
  for (auto &p : parts) {
    starts.push_back({uint32_t(chords), uint32_t(pieces), uint32_t(touches)});
    chords += p.flat.chords.size(), pieces += p.flat.pieces.size(), touches += p.touches.size(), tangents += p.flat.tangents.size();
  }
  if (chords > UINT32_MAX / 2 || touches > UINT32_MAX / 2) throw std::bad_alloc();
  st.piece_stroke = Buffer<uint32_t>(pieces + 1);
  flat.pieces.extend(pieces), flat.piece_info.extend(pieces), flat.chords.extend(chords), flat.chord_info.extend(chords);
  flat.tangents.extend(tangents), st.touches.extend(touches);
  threads().run(int(parts.size()), 1, [&](int k, int) {
    const Part<S> &p = parts[k];
    const Start at = starts[k];
    auto put = [](const auto &to, const auto &from, uint32_t i) {
      if (from.size()) std::memcpy(static_cast<void *>(to.begin() + i), from.begin(), from.size() * sizeof(*from.begin()));
    };
    put(flat.pieces, p.flat.pieces, at.piece), put(flat.piece_info, p.flat.piece_info, at.piece);
    put(flat.chords, p.flat.chords, at.chord), put(flat.chord_info, p.flat.chord_info, at.chord), put(flat.tangents, p.flat.tangents, at.chord);
    put(st.touches, p.touches, at.touch);
    for (size_t i = at.piece; i < at.piece + p.flat.pieces.size(); i++) {
      PieceInfo &info = flat.piece_info[i];
      info.first_chord += at.chord, info.end_chord += at.chord;
      st.piece_stroke[i] = info.stroke;
    }
    for (size_t i = at.chord; i < at.chord + p.flat.chords.size(); i++) flat.chord_info[i].piece += at.piece;
    for (size_t i = at.touch; i < at.touch + p.touches.size(); i++)
      st.touches[i].first += at.chord, st.touches[i].last += at.chord, st.touches[i].piece += at.piece;
  });
}

// Entries by tile, there in the order of strokes (a counting sort), and in that order a slot for every piece that an entry may meet.
template <class S> void sort_touches(State<S> &st) {
  const size_t tiles = size_t(st.job.views) * st.job.tiles_x * st.job.tiles_y;
  st.tile_first = Buffer<uint32_t>(tiles + 1), st.entries = Buffer<Entry>(st.touches.size() + 1);
  uint32_t *first = st.tile_first.get();
  std::fill_n(first, tiles + 1, 0);
  for (auto &t : st.touches) first[t.tile]++;
  uint32_t total = 0;
  for (size_t i = 0; i <= tiles; i++) total += std::exchange(first[i], total);
  for (auto &t : st.touches) {
    t.entry = first[t.tile]++;
    st.entries[t.entry] = {t.stroke, t.first, t.last, t.piece, t.pieces, 0, t.smooth};
  }
  for (size_t i = tiles; i > 0; i--) first[i] = first[i - 1];
  first[0] = 0;
  uint32_t slot = 0;
  for (size_t i = 0; i < st.touches.size(); i++) {
    Entry &e = st.entries[i];
    e.slot = slot, slot += e.pieces;
  }
  st.entries[st.touches.size()] = {0, 0, 0, 0, 0, slot, false};
}

template <class S> void prepare(State<S> &st) {
  const Input<S> &in = st.input;
  Job<S> &J = st.job;
  J.views = in.views, J.strokes = in.strokes, J.height = in.height, J.width = in.width, J.world = in.world;
  J.tiles_x = (in.width + TILE - 1) / TILE, J.tiles_y = (in.height + TILE - 1) / TILE;
  const double sigma = std::sqrt(in.blur * in.blur + 1. / 12);
  J.filter = in.strata ? Filter<S>{S(0), S(0)} : in.blur > 0 ? Filter<S>{S(1 / sigma), S(BLUR_REACH * sigma)} : Filter<S>{S(0), S(.5)};
  J.nearest = S(in.near / 2), J.chord_slack = S(2 * CHORD_TOL);
  J.strata = in.strata, J.seed = in.seed;
  J.background = in.background, J.background_view = in.background_view, J.background_row = in.background_row;
  J.background_pixel = in.background_pixel;
  const size_t count = size_t(in.views) * in.strokes, chunks = (count + CHUNK - 1) / CHUNK;
  st.reach = Buffer<S>(count + 1), st.scale = Buffer<double>(count + 1);
  st.piece_first = Buffer<uint32_t>(count + 1), st.touch_first = Buffer<uint32_t>(count + 1);
  std::vector<Part<S>> &parts = parts_of<S>(chunks);
  std::vector<std::unique_ptr<Binner>> binners(threads().size());
  threads().run(int(chunks), 1, [&](int k, int id) {
    if (!binners[id]) binners[id] = std::make_unique<Binner>(size_t(J.tiles_x) * J.tiles_y);
    Flattener flattener(in.height, in.width, in.strata > 0);
    for (size_t i = size_t(k) * CHUNK; i < std::min(count, size_t(k + 1) * CHUNK); i++) {
      Part<S> &part = parts[k];
      const size_t chords = part.flat.chords.size(), pieces = part.flat.pieces.size(), touches = part.touches.size();
      flatten_stroke(st, flattener, i, part);
      bin_stroke(st, i, uint32_t(chords), *binners[id], part);
      st.piece_first[i + 1] = uint32_t(part.flat.pieces.size() - pieces), st.touch_first[i + 1] = uint32_t(part.touches.size() - touches);
    }
  });
  join_parts(st, parts);
  add_up(st.piece_first, count), add_up(st.touch_first, count);
  sort_touches(st);
  J.pieces = st.flat.pieces.begin(), J.piece_stroke = st.piece_stroke.get();
  J.chords = st.flat.chords.begin(), J.chord_info = st.flat.chord_info.begin();
  J.entries = st.entries.get(), J.tile_first = st.tile_first.get(), J.reach = st.reach.get();
}

// Where the points of every outline lie, by piece and by tile.
template <class S> struct Outlines {
  Buffer<OutlinePoint<S>> points;
  Buffer<uint32_t> piece_first, order, tile_first;
  Buffer<S> gradient;
};
template <class S> Outlines<S> sample_outlines(const State<S> &st) {
  const Job<S> &J = st.job;
  const size_t pieces = st.flat.pieces.size(), tiles = size_t(J.views) * J.tiles_x * J.tiles_y;
  const OutlineSampler<S, Flat<S>> sampler(st.flat, J.world, J.strata, J.seed);
  auto tile_of = [&](const OutlinePoint<S> &o) -> int64_t {
    if (!(o.x >= 0 && o.y >= 0 && o.x < J.width && o.y < J.height)) return -1;
    return (int64_t(st.piece_stroke[o.piece] / J.strokes) * J.tiles_y + int(o.y) / TILE) * J.tiles_x + int(o.x) / TILE;
  };
  Outlines<S> out;
  out.piece_first = Buffer<uint32_t>(pieces + 1), out.tile_first = Buffer<uint32_t>(tiles + 1);
  uint32_t *first = out.piece_first.get();
  first[pieces] = 0;
  threads().run(int(pieces), 8, [&](int p, int) {
    first[p] = 0;
    sampler.piece(uint32_t(p), [&](uint32_t, const OutlinePoint<S> &o) { first[p] += tile_of(o) >= 0; });
  });
  uint64_t total = 0;
  for (size_t p = 0; p <= pieces; p++) {
    const uint64_t n = std::exchange(first[p], uint32_t(total));
    if ((total += n) > UINT32_MAX) throw std::bad_alloc();
  }
  out.points = Buffer<OutlinePoint<S>>(total + 1), out.order = Buffer<uint32_t>(total + 1), out.gradient = Buffer<S>(total + 1);
  threads().run(int(pieces), 8, [&](int p, int) {
    uint32_t at = first[p];
    sampler.piece(uint32_t(p), [&](uint32_t, const OutlinePoint<S> &o) { if (tile_of(o) >= 0) out.points[at++] = o; });
  });
  uint32_t *tile = out.tile_first.get(), sum = 0;
  std::fill_n(tile, tiles + 1, 0);
  for (uint32_t i = 0; i < total; i++) tile[tile_of(out.points[i])]++;
  for (size_t t = 0; t <= tiles; t++) sum += std::exchange(tile[t], sum);
  for (uint32_t i = 0; i < total; i++) out.order[tile[tile_of(out.points[i])]++] = i;
  for (size_t t = tiles; t > 0; t--) tile[t] = tile[t - 1];
  tile[0] = 0;
  return out;
}

// Gradient of one stroke in one view from the sums of its pieces (in order), in double precision.
template <class S> void finish_view(const State<S> &st, const Job<S> &J, const S *outline_sums, size_t i, double *g_cubic, double *look) {
  double stroke[16] = {};
  const uint32_t p0 = st.piece_first[i], p1 = st.piece_first[i + 1];
  for (uint32_t p = p0; p < p1; p++) {
    double m[NGRAD] = {}, control[16];
    for (uint32_t t = st.touch_first[i]; t < st.touch_first[i + 1]; t++) {
      const auto &touch = st.touches[t];
      if (p < touch.piece || p >= touch.piece + touch.pieces) continue;
      const S *sums = J.g_slot + size_t(st.entries[touch.entry].slot + (p - touch.piece)) * NGRAD;
      for (int k = 0; k < NGRAD; k++) m[k] += sums[k];
    }
    for (int k = 0; outline_sums && k < NGRAD; k++) m[k] += outline_sums[size_t(p) * NGRAD + k];
    control_gradient<double>(m, st.flat.pieces[p].ox, st.flat.pieces[p].oy, control);
    const double *map = st.flat.piece_info[p].map;
    for (int a = 0; a < 4; a++)
      for (int b = 0; b < 4; b++)
        for (int k = 0; k < 4; k++) stroke[4 * b + k] += map[4 * a + b] * control[4 * a + k];
    for (int k = 0; k < 5; k++) look[k] += m[16 + k];
  }
  for (int k = 0; k < 16; k++) g_cubic[k] = stroke[k] * st.scale[i];
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

template <class S> Gradients<S> backward(const State<S> &st, const Upstream<S> &up, const S *alpha, const S *depth, bool background) {
  const Input<S> &in = st.input;
  Job<S> J = st.job;
  const size_t count = size_t(J.views) * J.strokes, tiles = size_t(J.views) * J.tiles_x * J.tiles_y;
  const size_t pixels = size_t(J.views) * J.height * J.width, pieces = st.flat.pieces.size();
  Gradients<S> out{Buffer<double>(16 * count), Buffer<S>(in.half_width_per_view ? count : J.strokes), Buffer<S>(3 * size_t(J.strokes)),
                   Buffer<S>(J.strokes), Buffer<S>(background ? 3 * pixels : 0)};
  Buffer<S> slots(size_t(st.entries[st.touches.size()].slot) * NGRAD), outline_sums(J.strata ? pieces * NGRAD : 0);
  J.g_color = up.color, J.g_alpha = up.alpha, J.g_depth = up.depth, J.g_slot = slots.get();
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
      kernels<S>().outline_piece(J, p, outlines.piece_first[p], outlines.piece_first[p + 1], outline_sums.get() + size_t(p) * NGRAD);
    });
  }
  threads().run(J.strokes, 16, [&](int n, int) {
    double total[5] = {};
    for (int v = 0; v < J.views; v++) {
      const size_t i = size_t(v) * J.strokes + n;
      double look[5] = {};  // half width, opacity, colour
      finish_view(st, J, J.strata ? outline_sums.get() : nullptr, i, out.cubics.get() + 16 * i, look);
      if (in.half_width_per_view) out.half_width[i] = in.width_scale * S(look[0]);
      for (int k = 0; k < 5; k++) total[k] += look[k];
    }
    if (!in.half_width_per_view) out.half_width[n] = in.width_scale * S(total[0]);
    out.opacity[n] = S(total[1]);
    for (int k = 0; k < 3; k++) out.color[3 * n + k] = S(total[2 + k]);
  });
  return out;
}

template struct State<float>;
template struct State<double>;
template Images<float> forward(State<float> &, bool);
template Images<double> forward(State<double> &, bool);
template Gradients<float> backward(const State<float> &, const Upstream<float> &, const float *, const float *, bool);
template Gradients<double> backward(const State<double> &, const Upstream<double> &, const double *, const double *, bool);
}  // namespace stroke
