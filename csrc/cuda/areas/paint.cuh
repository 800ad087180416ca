// Layers painted over each other, a pixel by one thread; and back to coverages and paints.
#pragma once
#include "cuda/areas/job.cuh"

namespace stroke::areas {
// visit(paint, position of the share) for all layers over a pixel, from the bottom to the top or backwards.
template <class Visit> __device__ void each_layer(const Job &J, u32 pixel, bool backwards, Visit visit) {
  const Tables<real> tables = tables_of(J);
  const int x = int(pixel % J.width), row = int(pixel / J.width);
  for (int k = 0; k < J.layer_count; k++) {
    const int layer = backwards ? J.layer_count - 1 - k : k;
    const Run run = run_of(J, layer, row);
    if (run.left <= x && x < run.right) visit(Paint<real>(tables, J.layers[5 * layer + 4]), run.share + u32(x - run.left));
  }
}
__device__ inline Color color_at(const Job &J, const Paint<real> &paint, u32 pixel) {
  return paint.plain() ? paint.color() : paint.color(int(pixel % J.width), int(pixel / J.width));
}
// visit(pixel, position of the share) before each layer.
template <class Visit> __device__ Pixel painted(const Job &J, u32 pixel, Visit visit) {
  Pixel p = {};
  if (J.background) {
    const real *b = J.background + 4 * u64(pixel);
    for (int k = 0; k < 3; k++) p.straight[k] = p.color[k] = b[k];
    p.alpha = b[3], p.all = 1;
  }
  each_layer(J, pixel, false, [&](const Paint<real> &paint, u32 at) {
    visit(p, at);
    if (J.shares[at] > 0) p.paint(J.shares[at], color_at(J, paint, pixel));
  });
  return p;
}
__device__ inline void paint_pixel(const Job &J, u32 pixel) {
  const Pixel p = painted(J, pixel, [](const Pixel &, u32) {});
  real *out = J.image + 4 * u64(pixel);
  for (int k = 0; k < 3; k++) out[k] = real(p.straight[k]);
  out[3] = real(p.alpha);
}

__device__ inline void differentiate_pixel(const Job &J, u32 pixel) {
  painted(J, pixel, [&](const Pixel &p, u32 at) {
    real *state = J.states + 8 * u64(at);
    for (int k = 0; k < 3; k++) state[k] = real(p.straight[k]), state[3 + k] = real(p.color[k]);
    state[6] = real(p.alpha), state[7] = real(p.all);
  });
  const real *up = J.g_image + 4 * u64(pixel);
  Pixel g = {{up[0], up[1], up[2]}, {0, 0, 0}, up[3], 0};
  each_layer(J, pixel, true, [&](const Paint<real> &paint, u32 at) {
    real *state = J.states + 8 * u64(at);
    const Pixel before = {{state[0], state[1], state[2]}, {state[3], state[4], state[5]}, state[6], state[7]};
    Color g_color;
    J.g_shares[at] = real(before.backward(J.shares[at], color_at(J, paint, pixel), g, g_color));
    for (int k = 0; k < 4; k++) state[k] = real(g_color[k]);
  });
  if (!J.g_background) return;
  real *out = J.g_background + 4 * u64(pixel);
  for (int k = 0; k < 3; k++) out[k] = real(g.straight[k] + g.color[k]);
  out[3] = real(g.alpha);
}

// The gradients of a layer's paint, summed over a row of pixels.
__device__ inline void sum_row(const Job &J, int layer, int row) {
  const Run run = run_of(J, layer, row);
  if (run.left == run.right) return;
  const Paint<real> paint(tables_of(J), J.layers[5 * layer + 4]);
  double *sums = J.row_sums + run.sums;
  for (int k = 0; k < paint.parameters(); k++) sums[k] = 0;
  for (int x = run.left; x < run.right; x++) {
    const u32 at = run.share + u32(x - run.left);
    if (J.shares[at] <= 0) continue;
    const real *state = J.states + 8 * u64(at);
    const Color g = {{state[0], state[1], state[2], state[3]}};
    paint.plain() ? paint.backward(g, sums) : paint.backward(x, row, g, sums);
  }
}
}  // namespace stroke::areas
