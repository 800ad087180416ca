// From the gradient of a tile's pixels to that of its fragments, and their sums: what the analytic and the Monte Carlo kernels share. Included by
// kernel.cpp only.
#pragma once
#include "common/adjoint.h"
#include "cpu/composite.h"

namespace stroke {
namespace {
constexpr int LOOK_AHEAD = 16;  // tiles, for one with fragments (empirical)

// Asks, a little at a time, for what the backward reads of the next tile that has fragments while this one is worked on: more than some twenty
// lines at once would have to wait for each other.
struct Ahead {
  const char *kept = nullptr, *kept_end = nullptr;
  const real *color = nullptr;
  size_t row = 0;
  int rows = 0;

  SIMD Ahead(const Job<real> &J, int tile) {
    const int tiles = J.views * J.tiles_x * J.tiles_y, end = tile + LOOK_AHEAD < tiles ? tile + LOOK_AHEAD : tiles - 1;
    while (++tile <= end && J.tiles[tile].fragments == 0) {}
    if (tile > end) return;
    kept = (const char *)J.tiles[tile].piece, kept_end = J.tiles[tile].end;
    if (!J.g_color) return;
    const Place p = place_of(J, tile);
    color = J.g_color + 3 * pixel_index(J, p, 0), row = 3 * size_t(J.width), rows = p.h;
  }
  SIMD void some() {
    for (int i = 0; i < 4 && kept < kept_end; i++, kept += 64) __builtin_prefetch(kept);
    if (rows-- > 0) {
      for (size_t i = 0; i < 3 * TILE * sizeof(real); i += 64) __builtin_prefetch((const char *)color + i);
      color += row;
    }
  }
};

// What the loss says of a tile. A fragment adds T a (pix . (color - plain, z - depth) + ink) to it, the background T behind; all times `scale`.
// Depth is sum(T a z) / sum(T a), here k.depth: its gradient goes to both sums. Returns `plain`: a background of one colour, whose blend weight all
// fragments then carry (sum T a + T = 1, and behind = 0); else zero.
PHASE v4 load_upstream(const Job<real> &J, const Place &p, Work &k, real scale) {
  if (p.w < TILE || p.h < TILE || !J.g_color)
    for (int i = 0; i < PIX; i++) k.pix[i] = v4{};
  for (int i = 0; i < PIX; i += VL) store(k.ink + i, vf{}), store(k.behind + i, vf{}), store(k.depth + i, vf{});
  const v4 only_color = {scale, scale, scale, 0};
  for (int y = 0; y < p.h; y++) {
    const size_t at = pixel_index(J, p, y);
    v4 *pix = k.pix + y * TILE;
    if (J.g_color) {
      const real *g = J.g_color + 3 * at;
      if (VL >= 4 && p.w == TILE) {
        for (int x = 0; x < TILE; x += VL) {
          const vf a = load(g + 3 * x), b = load(g + 3 * x + VL), c = load(g + 3 * x + 2 * VL), only = tile4(only_color);
          real *out = (real *)(pix + x);
          store(out, quads<0>(a, b) * only), store(out + VL, quads<1>(a, b) * only);
          store(out + 2 * VL, quads<2>(b, c) * only), store(out + 3 * VL, quads<3>(b, c) * only);
        }
      } else {
        for (int x = 0; x < p.w; x++) pix[x] = v4{g[3 * x], g[3 * x + 1], g[3 * x + 2], 0} * scale;
      }
      if (!plain_background(J)) {
        const real *bg = background_at(J, p, y);
        for (int x = 0; x < p.w; x++, bg += J.background_pixel) k.behind[y * TILE + x] = pix[x][0] * bg[0] + pix[x][1] * bg[1] + pix[x][2] * bg[2];
      }
    }
    if (J.g_alpha)
      for (int x = 0; x < p.w; x++) k.ink[y * TILE + x] = scale * J.g_alpha[at + x];
    if (J.g_depth)
      for (int x = 0; x < p.w; x++) {
        const real alpha = J.alpha[at + x];
        if (alpha > real(MIN_ALPHA)) pix[x][3] = scale * J.g_depth[at + x] / alpha, k.depth[y * TILE + x] = J.depth[at + x];
      }
  }
  if (!plain_background(J)) return v4{};
  const real *bg = background_at(J, p, 0);
  return v4{bg[0], bg[1], bg[2], 0};
}
SIMD v4 color_of(const Piece<real> &c) { return v4{c.color[0], c.color[1], c.color[2], 0}; }

// Value of a fragment to the loss. Where depth matters, k.z holds it.
SIMD real value_of(const Job<real> &J, const Tile &t, const Work &k, v4 color, uint32_t f) {
  const uint32_t px = t.pixel[f];
  if (J.g_depth) color[3] = k.z[f] - k.depth[px];
  const v4 q = k.pix[px] * color;
  return (q[0] + q[1]) + (q[2] + q[3]) + k.ink[px];
}
// k.g = dL/d(alpha) = T (value - behind), k.behind: the value of what is behind, which grows from far to near.
SIMD void differentiate_fragment(const Tile &t, Work &k, uint32_t f, real value) {
  real &behind = k.behind[t.pixel[f]];
  const real excess = value - behind;
  k.g[f] = ((const real *)t.T)[f] * excess;
  behind += ((const real *)t.a)[f] * excess;
}
// All fragments, far to near: layer by layer where they lie in order, else in t.order, with their values in k.spare first.
PHASE void differentiate_alpha(const Job<real> &J, const Tile &t, Work &k, v4 plain) {
  for (uint32_t l = t.layers; l-- > 0;) {
    const v4 color = color_of(J.pieces[t.piece[l]]) - plain;
    for (uint32_t f = t.first[l]; f < t.first[l + 1]; f++) {
      const real value = value_of(J, t, k, color, f);
      if (t.order) k.spare[f] = value;
      else differentiate_fragment(t, k, f, value);
    }
  }
  for (uint32_t i = t.order ? t.fragments : 0; i-- > 0;) differentiate_fragment(t, k, t.order[i], k.spare[t.order[i]]);
}

// Adds what shows of the background, times the gradient of the colour.
PHASE void background_gradient(const Job<real> &J, const Place &p, const Tile &t, Work &k, bool add) {
  const real *a = (const real *)t.a;
  for (int i = 0; i < PIX; i += VL) store(k.run + i, splat(1));
  for (uint32_t f = 0; f < t.fragments; f++) k.run[t.pixel[f]] *= 1 - a[f];
  for (int y = 0; y < p.h; y++) {
    real *out = J.g_background + 3 * pixel_index(J, p, y);
    for (int x = 0; x < p.w; x++)
      for (int c = 0; c < 3; c++) out[3 * x + c] = (add ? out[3 * x + c] : 0) + k.run[y * TILE + x] * k.pix[y * TILE + x][c];
  }
}

// Colour gradient of one layer: sum of T a dL/dI. Two sums, to halve the chain of dependent additions.
PHASE v4 color_gradient(const Tile &t, const Work &k, uint32_t l) {
  const real *T = (const real *)t.T, *a = (const real *)t.a;
  v4 even = {}, odd = {};
  uint32_t f = t.first[l];
  for (; f + 1 < t.first[l + 1]; f += 2) even += (T[f] * a[f]) * k.pix[t.pixel[f]], odd += (T[f + 1] * a[f + 1]) * k.pix[t.pixel[f + 1]];
  if (f < t.first[l + 1]) even += (T[f] * a[f]) * k.pix[t.pixel[f]];
  return even + odd;
}

SIMD void clear_slots(const Job<real> &J, int tile) {
  const size_t first = J.intersections[J.tile_first[tile]].slot, last = J.intersections[J.tile_first[tile + 1]].slot;
  std::memset(J.g_slot + first * NGRAD, 0, (last - first) * NGRAD * sizeof(real));
  if (J.g_square) std::memset(J.g_square + first * 4, 0, (last - first) * 4 * sizeof(real));
}
// Adds the sums of one layer to its slot, in the order of Moments.
template <int WIDTH> SIMD void add_to_slot(const Job<real> &J, uint32_t slot, const Moments<vf> &m, v4 color) {
  real *g = J.g_slot + size_t(slot) * NGRAD;
  for (int i = 0; i < 16; i += VL) store(g + i, load(g + i) + sums((const vf *)&m + i));
  g[OF_WIDTH] += sum(m.half_width[0]);
  if constexpr ((WIDTH & ALONG) != 0)
    for (int i = 1; i < 4; i++) g[OF_WIDTH + i] += sum(m.half_width[i]);
  g[OF_OPACITY] += sum(m.opacity);
  for (int i = 0; i < 3; i++) g[OF_COLOR + i] += color[i];
  for (int i = 0; J.g_square && i < 4; i++) J.g_square[size_t(slot) * 4 + i] += sum(m.square[i]);
}
}  // namespace
}  // namespace stroke
