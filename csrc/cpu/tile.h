// A tile of one view and the working memory of the thread that draws it. Included by kernel.cpp only. No std:: templates here: the linker
// would merge their instantiations across instruction sets.
#pragma once
#include "common/closest.h"
#include "common/coverage.h"
#include "cpu/kernel.h"

namespace stroke {
namespace {
constexpr int PIX = TILE * TILE, VPR = TILE / VL;  // pixels of a tile; vectors per row
typedef real v4 __attribute__((vector_size(4 * sizeof(real))));
#ifdef STROKE_PROFILE
#define PHASE __attribute__((noinline))  // to see the phases apart in a profile
#else
#define PHASE inline __attribute__((always_inline))
#endif

// Sort key: depth, then layer, the last one first (layers are numbered in the order of strokes). Positive floats are ordered as their bits are.
template <bool> struct KeyOf {
  using type = uint64_t;
};
template <> struct KeyOf<false> {
  using type = unsigned __int128;
};
using Key = KeyOf<F32>::type;
SIMD Key make_key(real depth, uint32_t l) {
  integer b;
  std::memcpy(&b, &depth, sizeof b);
  return Key(b) << 32 | uint32_t(~l);
}
SIMD uint32_t layer_of(Key key) { return ~uint32_t(key); }

// Where the points of a tile are: pixel centres, one place in every pixel (k.x, k.y), or k.x, k.y in any order.
enum { GRID, NEAR_GRID, ANYWHERE };

struct Layer {
  uint32_t piece, slot;
  real near, far;
};

// Working memory of a thread, in blocks of Scratch. Points are the tile's pixel centres, or other places in it (x, y relative to the tile).
struct Work {
  Scratch *scratch;
  // per point: sums of (r, g, b, depth) and of alpha, or dL/d(those); transmittance behind everything; the value of what is behind, in the backward;
  // a depth: the last one so far, the sum, or the mean
  alignas(64) v4 pix[PIX];
  alignas(64) real ink[PIX], run[PIX], behind[PIX], depth[PIX];
  // the nearest of a piece's chords, the second, and the best of all pieces
  alignas(64) real d2[PIX], second[PIX], second_tau[PIX], tau[PIX], x[PIX], y[PIX], best[PIX], best_tau[PIX];
  alignas(64) integer best_piece[PIX];
  // per fragment; before, per candidate (Candidates)
  uint32_t capacity = 0;
  real *t, *a, *z, *T, *g, *spare;  // parameter, alpha, depth, transmittance in front, a gradient
  integer *px;                      // point
  uint32_t *order;
  // per layer
  uint32_t layer_capacity = 0, layers = 0;
  Layer *layer;
  uint32_t *first, *perm;  // first fragment (layers + 1); layers by depth
  Key *layer_key;
  uint32_t *owner;  // layer of every vector of candidates
  // piles of fragments on every point: their depths and numbers, one place of all points after the other
  uint32_t pile_capacity = 0;
  real *pile_z;
  integer *pile;
};

// What is known of candidates, in memory that will be the fragments': a parameter to begin from, what Approach says of the first step, the point where
// distances are measured; then the nearest point's parameter, squared distance and homogeneous depth, which lies where the rate was.
struct Candidates {
  real *from, *tau, *d2, *rate, *z, *qx, *qy;
};
SIMD Candidates candidates(const Work &k) { return {.from = k.t, .tau = k.spare, .d2 = k.a, .rate = k.z, .z = k.z, .qx = k.T, .qy = k.g}; }

SIMD Work &work(Scratch &S) {
  Work *k = (Work *)work_memory(S, sizeof(Work));
  k->scratch = &S;
  return *k;
}
template <class T> void resize(Work &k, int block, T *&p, size_t keep, size_t n) {
  p = (T *)grow(*k.scratch, block, keep * sizeof(T), (n + 64) * sizeof(T));
}
// Room for n fragments; the first `keep` stay.
SIMD void reserve(Work &k, uint32_t keep, uint32_t n) {
  if (n <= k.capacity) return;
  const uint32_t m = k.capacity = n < 4096 ? 4096 : n + n / 2;
  resize(k, 0, k.t, keep, m), resize(k, 1, k.a, keep, m), resize(k, 2, k.z, keep, m), resize(k, 3, k.px, keep, m);
  resize(k, 4, k.T, 0, m), resize(k, 5, k.g, 0, m), resize(k, 6, k.spare, 0, m), resize(k, 7, k.order, 0, m);
  resize(k, 12, k.owner, keep / VL + 1, m / VL + 1);
}
SIMD void reserve_layers(Work &k, uint32_t n) {
  if (n <= k.layer_capacity) return;
  const uint32_t m = k.layer_capacity = n < 256 ? 256 : n + n / 2;
  resize(k, 8, k.layer, k.layers, m), resize(k, 9, k.first, k.layers + 1, m), resize(k, 10, k.perm, 0, m), resize(k, 11, k.layer_key, 0, m);
}

// Room for piles of n fragments each.
SIMD void reserve_piles(Work &k, uint32_t n) {
  if (n <= k.pile_capacity) return;
  const size_t m = k.pile_capacity = n < 16 ? 16 : n + n / 2;
  resize(k, 13, k.pile_z, 0, m * PIX), resize(k, 14, k.pile, 0, m * PIX);
}

// a tile's corner and its size inside the image
struct Place {
  int view, x, y, w, h;
};
SIMD Place place_of(const Job<real> &J, int tile) {
  const int x = tile % J.tiles_x * TILE, y = tile / J.tiles_x % J.tiles_y * TILE;
  const int w = J.width - x < TILE ? J.width - x : TILE, h = J.height - y < TILE ? J.height - y : TILE;
  return {tile / (J.tiles_x * J.tiles_y), x, y, w, h};
}
SIMD size_t pixel_index(const Job<real> &J, const Place &p, int y) { return (size_t(p.view) * J.height + p.y + y) * J.width + p.x; }
SIMD const real *background_at(const Job<real> &J, const Place &p, int y) {
  return J.background + p.view * J.background_view + (p.y + y) * J.background_row + p.x * J.background_pixel;
}
}  // namespace
}  // namespace stroke
