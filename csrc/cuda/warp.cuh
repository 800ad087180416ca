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
  T at = 0;
  total = 0;
  for (u32 w = 0; w < blockDim.x / WARP; w++) at += w < warp ? sums[w] : 0, total += sums[w];
  return at + before;
}

// From n counts to the first of each, and behind them their sum; one block. Each thread takes several numbers in a row, for which it waits once.
constexpr u32 IN_A_ROW = 8;
__device__ inline u64 add_up(u32 *a, u32 n) {
  u64 sum = 0;
  for (u32 start = 0; start < n; start += IN_A_ROW * blockDim.x) {
    const u32 first = start + IN_A_ROW * threadIdx.x;
    u32 counts[IN_A_ROW];
    u64 own = 0, total;
#pragma unroll
    for (u32 k = 0; k < IN_A_ROW; k++) counts[k] = first + k < n ? a[first + k] : 0, own += counts[k];
    u64 at = sum + block_prefix(own, total);
#pragma unroll
    for (u32 k = 0; k < IN_A_ROW; k++) {
      if (first + k < n) a[first + k] = u32(at);
      at += counts[k];
    }
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
