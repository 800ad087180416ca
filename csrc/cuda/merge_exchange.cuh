// Sorting by several threads at once.
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
}  // namespace stroke
