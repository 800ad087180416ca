// How the kernels that Python launches are written: each takes the job, and lists whose length only the device knows in strides. Behind the threads of a
// block may stand how many blocks a processor shall have registers for.
#pragma once
#include "cuda/warp.cuh"

#define KERNEL(name, ...) extern "C" __global__ void __launch_bounds__(__VA_ARGS__) name(const __grid_constant__ Job J)

namespace stroke {
template <class Work> __device__ void each_thread(u32 n, Work work) {
  for (u32 i = thread_index(); i < n; i += thread_total()) work(i);
}
template <class Work> __device__ void each_warp(u32 n, Work work) {
  for (u32 i = thread_index() / WARP; i < n; i += thread_total() / WARP) work(i);
}
// Counts of a list to its total, and places.
__device__ inline void total(const Job &J, int list, u32 *counts, u32 n) {
  const u64 sum = add_up(counts, n);
  if (threadIdx.x == 0) J.counters[list] = sum;
}
}  // namespace stroke
