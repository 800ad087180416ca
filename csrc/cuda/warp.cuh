// Lanes, sums and places within warps and blocks.
#pragma once
#include "cuda/job.cuh"

namespace stroke {
__device__ inline u32 lane() { return threadIdx.x % WARP; }
__device__ inline u32 thread_index() { return blockIdx.x * blockDim.x + threadIdx.x; }
__device__ inline u32 thread_total() { return gridDim.x * blockDim.x; }
__device__ inline u32 below(u32 mask) { return mask & ((1u << lane()) - 1); }

// The same sum in all lanes, in a fixed order.
template <class T> __device__ T warp_sum(T x) {
  for (int k = WARP / 2; k; k /= 2) x += __shfl_xor_sync(ALL, x, k);
  return x;
}
// Sum over the lanes before this one, and over all; of the type of the total.
template <class T> struct Same {
  using type = T;
};
template <class T> __device__ T warp_prefix(typename Same<T>::type x, T &total) {
  T sum = x;
  for (u32 k = 1; k < WARP; k *= 2) {
    const T other = __shfl_up_sync(ALL, sum, k);
    if (lane() >= k) sum += other;
  }
  total = __shfl_sync(ALL, sum, WARP - 1);
  return sum - x;
}
// The same over the threads of a block.
template <class T> __device__ T block_prefix(typename Same<T>::type x, T &total) {
  __shared__ T sums[WARP];
  T of_warp;
  const T before = warp_prefix(x, of_warp);
  const u32 warp = threadIdx.x / WARP;
  __syncthreads();
  if (lane() == 0) sums[warp] = of_warp;
  __syncthreads();
  const T of_warps = warp_prefix(lane() < blockDim.x / WARP ? sums[lane()] : 0, total);
  return __shfl_sync(ALL, of_warps, warp) + before;
}

// Four numbers in a row, which are read and written at once; those from the n-th of an array on are 0, and stay as they are there.
struct alignas(16) InARow {
  u32 k[4];
};
__device__ inline InARow load_row(const u32 *a, u32 first, u32 n) {
  if (first + 4 <= n) return *reinterpret_cast<const InARow *>(a + first);
  InARow some = {};
  for (u32 k = 0; first + k < n; k++) some.k[k] = a[first + k];
  return some;
}
__device__ inline void store_row(u32 *a, u32 first, u32 n, const InARow &some) {
  if (first + 4 <= n) *reinterpret_cast<InARow *>(a + first) = some;
  else
    for (u32 k = 0; first + k < n; k++) a[first + k] = some.k[k];
}
// From n counts to the first of each, and behind them their sum; one block. The next counts are on their way while these are added up.
__device__ inline u64 add_up(u32 *a, u32 n) {
  u64 sum = 0;
  const u32 step = 4 * blockDim.x;
  InARow next = load_row(a, 4 * threadIdx.x, n);
  for (u32 first = 4 * threadIdx.x, start = 0; start < n; start += step, first += step) {
    const InARow counts = next;
    next = load_row(a, first + step, n);
    u64 total, at = sum + block_prefix(u64(counts.k[0]) + counts.k[1] + counts.k[2] + counts.k[3], total);
    InARow places;
    for (u32 k = 0; k < 4; k++) places.k[k] = u32(at), at += counts.k[k];
    store_row(a, first, n, places);
    sum += total;
  }
  if (threadIdx.x == 0) a[n] = u32(sum);
  return sum;
}

// Position of the n-th bit that is set, counted from 0.
__device__ inline u32 nth_bit(u32 mask, u32 n) {
  u32 at = 0;
  for (u32 w = WARP / 2; w; w /= 2) {
    const u32 c = __popc(mask >> at & ((1u << w) - 1));
    if (n >= c) n -= c, at += w;
  }
  return at;
}
}  // namespace stroke
