// The kernels of filled and stroked layers, in the order of their launch.
#include "cuda/areas/cover.cuh"
#include "cuda/areas/gather.cuh"
#include "cuda/areas/outline.cuh"
#include "cuda/areas/paint.cuh"
#include "cuda/launch.cuh"

namespace stroke::areas {
// visit(layer, row) for all layers and rows of the picture.
template <class Visit> __device__ void each_row(const Job &J, Visit visit) {
  each_thread(u32(J.layer_count) * u32(J.height), [&](u32 i) { visit(int(i / J.height), int(i % J.height)); });
}

KERNEL(begin_layers, 128) {
  each_thread(COUNTERS, [&](u32 k) { J.counters[k] = 0; });
  each_thread(u32(J.limit[VERTICES]), [&](u32 v) { J.links[v] = {-1, -1}; });
  each_warp(u32(J.part_count), [&](u32 j) { count_vertices(J, int(j)); });
}
KERNEL(place_vertices, 1024) {
  const u64 sum = add_up(J.vertex_first, u32(J.part_count));
  if (threadIdx.x == 0) J.counters[VERTICES] = sum;
}
KERNEL(write_vertices, 128) {
  if (vertex_count(J)) each_warp(u32(J.part_count), [&](u32 j) { write_vertices(J, int(j)); });
}
KERNEL(span_edges, 128) {
  each_thread(vertex_count(J), [&](u32 e) { span_edge(J, int(e)); });
  if (vertex_count(J)) each_warp(u32(J.layer_count), [&](u32 l) { bound_layer(J, int(l)); });
}
KERNEL(cover_rows, 128) {
  const bool any = vertex_count(J);
  each_row(J, [&](int layer, int row) { run_of(J, layer, row) = any ? cover_row(J, layer, row) : Run{}; });
}
KERNEL(paint_layers, 128) {
  each_thread(u32(J.width) * u32(J.height), [&](u32 i) { paint_pixel(J, i); });
}

KERNEL(differentiate_pixels, 128) {
  each_thread(u32(J.width) * u32(J.height), [&](u32 i) { differentiate_pixel(J, i); });
}
KERNEL(sum_rows, 128) {
  each_row(J, [&](int layer, int row) { sum_row(J, layer, row); });
  each_thread(vertex_count(J), [&](u32 e) { back_to_edge(J, int(e)); });
}
KERNEL(sum_parts, 128) {
  each_warp(u32(J.part_count), [&](u32 j) { sum_part(J, int(j)); });
}
KERNEL(sum_layers, 128) {
  each_warp(u32(J.layer_count), [&](u32 l) { sum_layer(J, int(l)); });
}
KERNEL(finish_layers, 128) {
  each_thread(u32(J.point_count), [&](u32 i) { finish_point(J, i); });
  each_thread(6 * u32(J.transform_count), [&](u32 i) { finish_transform(J, i); });
  each_thread(4 * u32(J.paint_count), [&](u32 i) { finish_axis(J, i); });
  each_thread(u32(J.stop_count), [&](u32 i) { finish_stop(J, i); });
}
}  // namespace stroke::areas
