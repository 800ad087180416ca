// Sorting by several threads at once, and the fragments of a point near to far.
#pragma once
#include "cuda/warp.cuh"

namespace stroke {
// Batcher's merge exchange (Knuth, The Art of Computer Programming 3, algorithm 5.2.2M), which compares the same places whatever lies there: n things
// by so many threads, of which this is number `thread`. exchange(i, j) puts those at i < j in order; wait() is for all threads.
template <class Exchange, class Wait> __device__ void sort_together(u32 n, u32 thread, u32 threads, Exchange exchange, Wait wait) {
  u32 top = 1;
  while (2 * top < n) top *= 2;
  for (u32 p = top; p > 0; p /= 2)
    for (u32 q = top, r = 0, d = p;; d = q - p, q /= 2, r = p) {
      // The places i with (i & p) == r.
      for (u32 k = thread, i; (i = 2 * k - (k & (p - 1)) + r) + d < n; k += threads) exchange(i, i + d);
      wait();
      if (q == p) break;
    }
}

// A point's fragments near to far: the first few as they come, in shared memory. Of equal depths the later stroke comes
// first, whose fragment has the greater number.
constexpr u32 SHORT_LIST = 64 / sizeof(real);  // half of the 48 kB that every GPU has for a block (empirical: few points have more)
struct ShortLists {
  real z[SHORT_LIST][PIX];
  u32 fragment[SHORT_LIST][PIX];
};
__device__ inline void insert(ShortLists &s, u32 n, real z, u32 fragment) {
  if (n >= SHORT_LIST) return;
  const u32 t = threadIdx.x;
  for (; n > 0 && s.z[n - 1][t] >= z; n--) s.z[n][t] = s.z[n - 1][t], s.fragment[n][t] = s.fragment[n - 1][t];
  s.z[n][t] = z, s.fragment[n][t] = fragment;
}

// A longer list, of any length, by all lanes: in the warp's part of the shared memory, which its short lists have left, or where it lies if that is
// too small.
__device__ inline void sort_long(ShortLists &s, u32 *list, u32 n, const Cover *fragments) {
  auto wait = [] { __syncwarp(); };
  auto farther = [](real z, u32 i, real other, u32 j) { return z > other || (z == other && i < j); };
  if (n > SHORT_LIST * WARP) {
    auto exchange = [&](u32 i, u32 j) {
      const u32 a = list[i], b = list[j];
      if (farther(fragments[a].z, a, fragments[b].z, b)) list[i] = b, list[j] = a;
    };
    sort_together(n, lane(), WARP, exchange, wait);
    return;
  }
  const u32 own = threadIdx.x - lane();
  auto z = [&](u32 k) -> real & { return s.z[k / WARP][own + k % WARP]; };
  auto fragment = [&](u32 k) -> u32 & { return s.fragment[k / WARP][own + k % WARP]; };
  for (u32 k = lane(); k < n; k += WARP) fragment(k) = list[k], z(k) = fragments[list[k]].z;
  wait();
  auto exchange = [&](u32 i, u32 j) {
    const u32 a = fragment(i), b = fragment(j);
    const real za = z(i), zb = z(j);
    if (farther(za, a, zb, b)) fragment(i) = b, fragment(j) = a, z(i) = zb, z(j) = za;
  };
  sort_together(n, lane(), WARP, exchange, wait);
  for (u32 k = lane(); k < n; k += WARP) list[k] = fragment(k);
}
}  // namespace stroke
