// Segments to the vertices of polygons, each by one warp: counted first, then written.
#pragma once
#include "cuda/areas/job.cuh"

namespace stroke::areas {
// What both do alike.
struct Reserving {
  int next;
  __device__ int reserve(int n) {
    next += n;
    return next - n;
  }
  template <class F> __device__ bool any(int n, F f) {
    bool found = false;
    for (int k = int(lane()); k < n && !found; k += WARP) found = f(k);
    return __ballot_sync(ALL, found);
  }
};
struct Counting : Reserving {
  template <class F> __device__ void each(int, F) {}
  __device__ void put(int, const Vertex &) {}
  __device__ void edge(int, int) {}
};
struct Writing : Reserving {
  const Job &J;
  template <class F> __device__ void each(int n, F f) {
    for (int k = int(lane()); k < n; k += WARP) f(k);
  }
  __device__ void put(int i, const Vertex &vertex) { J.vertices[i] = vertex; }
  __device__ void edge(int a, int b) { J.links[a].next = b, J.links[b].previous = a; }
};

template <class Sink> __device__ void outline_part(const Job &J, int j, int begin, Sink &sink) {
  const Part &part = J.parts[j];
  Outliner<Sink> outliner(matrix_of(J, part.layer), sink);
  auto segments = [&](int i) { return segment_of(J, i); };
  auto places = [](const Segment &s, int i, double scale) { return Along(s, i, scale); };
  if (J.layers[5 * part.layer + 2] == STROKE) outliner.outline(j, part.first, part.count, part.closed, segments, places);
  else outliner.fill(segments(j), j, part.first, part.count, begin);
}
__device__ inline void count_vertices(const Job &J, int j) {
  Counting sink = {{0}};
  outline_part(J, j, 0, sink);
  if (lane() == 0) J.vertex_first[j] = u32(sink.next);
}
__device__ inline void write_vertices(const Job &J, int j) {
  Writing sink = {{int(J.vertex_first[j])}, J};
  outline_part(J, j, int(J.vertex_first[J.parts[j].first]), sink);
}

__device__ inline void span_edge(const Job &J, int e) {
  const auto span = polygons_of(J).heads(e);
  J.heads[e] = rows_between(J, span.first, span.end);
}
// By one warp.
__device__ inline void bound_layer(const Job &J, int layer) {
  double low = 1e300, high = -1e300;
  for (u32 v = J.vertex_first[J.layer_parts[layer]] + lane(); v < J.vertex_first[J.layer_parts[layer + 1]]; v += WARP)
    low = min(low, J.vertices[v].y), high = max(high, J.vertices[v].y);
  for (int k = WARP / 2; k; k /= 2) low = min(low, __shfl_xor_sync(ALL, low, k)), high = max(high, __shfl_xor_sync(ALL, high, k));
  if (lane() == 0) J.bounds[layer] = rows_between(J, floor(low), ceil(high));
}
}  // namespace stroke::areas
