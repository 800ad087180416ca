// Occlusion, first half: fragments of a tile sorted by depth, layers as a whole where they do not overlap, else per point; composite.h blends
// them. Included by kernel.cpp only.
#pragma once
#include "cpu/hits.h"

namespace stroke {
namespace {
// Heap sort for long lists; insertion sort is faster for short ones.
constexpr uint32_t INSERT_MAX = 24;
SIMD void sort_keys(Key *a, uint32_t n) {
  if (n <= INSERT_MAX) {
    for (uint32_t i = 1; i < n; i++) {
      const Key x = a[i];
      uint32_t j = i;
      for (; j > 0 && a[j - 1] > x; j--) a[j] = a[j - 1];
      a[j] = x;
    }
    return;
  }
  for (uint32_t start = n / 2, end = n;;) {
    Key x;
    if (start > 0) x = a[--start];
    else {
      if (--end == 0) return;
      x = a[end], a[end] = a[0];
      if (end == 1) {
        a[0] = x;
        return;
      }
    }
    uint32_t i = start;
    for (uint32_t child; (child = 2 * i + 1) < end; i = child) {
      if (child + 1 < end && a[child + 1] > a[child]) child++;
      if (x >= a[child]) break;
      a[i] = a[child];
    }
    a[i] = x;
  }
}

// Whether the layers g0 .. g1 (in k.perm), one after the other, are near to far at every point.
SIMD bool in_order(Work &k, uint32_t g0, uint32_t g1) {
  for (int i = 0; i < PIX; i += VL) store(k.depth + i, vf{});
  bool good = true;
  for (uint32_t g = g0; g < g1 && good; g++)
    for (uint32_t f = k.first[k.perm[g]]; f < k.first[k.perm[g] + 1]; f++) {
      real &last = k.depth[k.px[f]];
      good &= last < k.z[f];
      last = k.z[f];
    }
  return good;
}

// Puts places i < j of VL piles in order: by depth, fragments of equal depth by number, the last one first.
SIMD void order_pair(real *z, integer *f, size_t i, size_t j) {
  const vf zi = load(z + i * PIX), zj = load(z + j * PIX);
  const vi fi = load(f + i * PIX), fj = load(f + j * PIX), swap = (zi > zj) | ((zi == zj) & (fi < fj));
  store(z + i * PIX, select(swap, zj, zi)), store(z + j * PIX, select(swap, zi, zj));
  store(f + i * PIX, swap ? fj : fi), store(f + j * PIX, swap ? fi : fj);
}
// VL piles of n places at once, by Batcher's merge exchange (Knuth, The Art of Computer Programming 3, algorithm 5.2.2M): it compares the same
// places whatever lies there.
SIMD void sort_piles(real *z, integer *f, uint32_t n) {
  uint32_t top = 1;
  while (2 * top < n) top *= 2;
  for (uint32_t p = top; p > 0; p /= 2)
    for (uint32_t q = top, r = 0, d = p;; d = q - p, q /= 2, r = p) {
      for (uint32_t i = 0; i + d < n; i++)
        if ((i & p) == r) order_pair(z, f, i, i + d);
      if (q == p) break;
    }
}

// Writes the fragments of VL piles from point v on near to far, of so many each. Returns where the next ones go.
SIMD uint32_t *order_piles(Work &k, uint32_t v, const uint32_t *height, uint32_t *out) {
  constexpr integer NONE = 0x7fffffff;  // above all numbers of fragments
  vi heights;
  uint32_t n = 0;
  for (int i = 0; i < VL; i++) heights[i] = integer(height[v + i]), n = height[v + i] > n ? height[v + i] : n;
  real *z = k.pile_z + v;
  integer *f = k.pile + v;
  vf above = splat(real(-1));
  vi number = {}, wrong = {};
  for (size_t j = 0; j < n; j++) {
    const vf depth = load(z + j * PIX);
    const vi fragment = load(f + j * PIX);
    wrong |= (splat_int(integer(j)) < heights) & ((depth < above) | ((depth == above) & (fragment > number)));
    above = depth, number = fragment;
  }
  if (any(wrong)) {                   // in most rows layers lie in their order
    for (size_t j = 0; j < n; j++) {  // empty places come last
      const vi in = splat_int(integer(j)) < heights;
      store(z + j * PIX, select(in, load(z + j * PIX), splat(real(__builtin_inf())))), store(f + j * PIX, in ? load(f + j * PIX) : splat_int(NONE));
    }
    sort_piles(z, f, n);
  }
  for (size_t j = 0; j < n; j++) {
    const Mask m = bits(splat_int(integer(j)) < heights);
    compress_store(out, load(f + j * PIX), m);
    out += count(m);
  }
  return out;
}

// Writes the fragments of the layers g0 .. g1 (in k.perm) near to far per point. Returns where the next ones go.
PHASE uint32_t *sort_points(Work &k, uint32_t g0, uint32_t g1, uint32_t *out) {
  uint32_t height[PIX] = {};
  reserve_piles(k, g1 - g0);
  for (uint32_t g = g0; g < g1; g++)
    for (uint32_t f = k.first[k.perm[g]]; f < k.first[k.perm[g] + 1]; f++) {
      const integer px = k.px[f];
      const size_t at = size_t(height[px]++) * PIX + px;
      k.pile_z[at] = k.z[f], k.pile[at] = integer(f);
    }
  for (uint32_t v = 0; v < PIX; v += VL) out = order_piles(k, v, height, out);
  return out;
}

// The last of the layers from g0 on (in k.perm, by their nearest depth) whose depths overlap, and one more.
SIMD uint32_t overlap_end(const Work &k, uint32_t g0) {
  uint32_t g1 = g0 + 1;
  for (real far = k.layer[k.perm[g0]].far; g1 < k.layers && k.layer[k.perm[g1]].near <= far; g1++) far = max(far, k.layer[k.perm[g1]].far);
  return g1;
}

// Sorts the layers by their nearest depth, in k.perm. Returns how many of them, from the first on, are near to far at every point.
PHASE uint32_t sort_layers(Work &k) {
  const uint32_t L = k.layers;
  for (uint32_t l = 0; l < L; l++) k.layer_key[l] = make_key(k.layer[l].near, l);
  sort_keys(k.layer_key, L);
  for (uint32_t l = 0; l < L; l++) k.perm[l] = layer_of(k.layer_key[l]);
  for (uint32_t g0 = 0, g1; g0 < L; g0 = g1) {
    g1 = overlap_end(k, g0);
    if (g1 > g0 + 1 && !in_order(k, g0, g1)) return g0;
  }
  return L;
}

SIMD uint32_t *append_layers(const Work &k, uint32_t g0, uint32_t g1, uint32_t *out) {
  for (uint32_t g = g0; g < g1; g++)
    for (uint32_t f = k.first[k.perm[g]]; f < k.first[k.perm[g] + 1]; f++) *out++ = f;
  return out;
}

// k.order: fragments near to far per point, given what sort_layers found. Layers whose depths overlap are sorted per point where they must be.
PHASE void sort_fragments(Work &k, uint32_t sorted) {
  uint32_t *out = append_layers(k, 0, sorted, k.order);
  for (uint32_t g0 = sorted, g1; g0 < k.layers; g0 = g1) {
    g1 = overlap_end(k, g0);
    const bool good = g1 == g0 + 1 || (g0 > sorted && in_order(k, g0, g1));
    out = good ? append_layers(k, g0, g1, out) : sort_points(k, g0, g1, out);
  }
}
}  // namespace
}  // namespace stroke
