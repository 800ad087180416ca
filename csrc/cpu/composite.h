// Occlusion, second half: sorted fragments of a tile composited (blended) near to far, kept for the backward, and written to the images.
// Included by kernel.cpp only.
#pragma once
#include "cpu/sort.h"

namespace stroke {
namespace {
// k.T: the transmittance in front of each fragment; k.run: behind everything.
PHASE void transmit(Work &k, uint32_t n) {
  for (int i = 0; i < PIX; i += VL) store(k.run + i, splat(1));
  for (uint32_t i = 0; i < n; i++) {
    const uint32_t f = k.order[i];
    real &T = k.run[k.px[f]];
    k.T[f] = T;
    T -= T * k.a[f];
  }
}

// As vectors: GCC 12 makes "rep stos" of a loop over k.pix, which takes longer.
SIMD void clear_pixels(Work &k) {
  for (int i = 0; i < 4 * PIX; i += VL) store((real *)k.pix + i, vf{});
  for (int i = 0; i < PIX; i += VL) store(k.ink + i, vf{});
}

// k.pix = sum T a (r, g, b, depth) and k.ink = sum T a. (1 - k.run would be k.ink too, but for faint ink with few digits.)
PHASE void composite(const Job<real> &J, Work &k) {
  clear_pixels(k);
  for (uint32_t l = 0; l < k.layers; l++) {
    const Piece<real> &c = J.pieces[k.layer[l].piece];
    v4 color = {c.color[0], c.color[1], c.color[2], 0};
    for (uint32_t f = k.first[l]; f < k.first[l + 1]; f++) {
      color[3] = k.z[f];
      const real weight = k.T[f] * k.a[f];  // in the blend
      k.pix[k.px[f]] += weight * color, k.ink[k.px[f]] += weight;
    }
  }
}

// transmit and composite in one pass, for layers that are near to far at every point in the order of k.perm.
PHASE void blend_layers(const Job<real> &J, Work &k) {
  clear_pixels(k);
  for (int i = 0; i < PIX; i += VL) store(k.run + i, splat(1));
  for (uint32_t i = 0; i < k.layers; i++) {
    const uint32_t l = k.perm[i];
    const Piece<real> &c = J.pieces[k.layer[l].piece];
    v4 color = {c.color[0], c.color[1], c.color[2], 0};
    for (uint32_t f = k.first[l]; f < k.first[l + 1]; f++) {
      const integer px = k.px[f];
      const real T = k.run[px], weight = T * k.a[f];
      color[3] = k.z[f];
      if (J.save) k.T[f] = T;
      k.run[px] = T - weight;
      k.pix[px] += weight * color, k.ink[px] += weight;
    }
  }
}

// Leaves the tile's fragments for the backward, in one run of memory. sorted: the layers are near to far at every point in the order of k.perm;
// then they lie in that order.
SIMD void save_tile(Tile &t, const Work &k, uint32_t n, bool sorted, Arena &A) {
  const uint32_t L = k.layers;
  auto bytes = [](size_t count, size_t size) { return (count * size + 127) / 64 * 64; };  // and room for a vector behind the end
  char *p = (char *)arena_take(A, 3 * bytes(L + 1, 4) + bytes(sorted ? 0 : n, 4) + 3 * bytes(n, sizeof(real)) + bytes(n, 1));
  auto take = [&](auto *&array, size_t count) { array = (std::remove_reference_t<decltype(array)>)p, p += bytes(count, sizeof(*array)); };
  real *tau, *a, *T;
  t.layers = L, t.fragments = n, t.order = nullptr;
  take(t.piece, L + 1), take(t.slot, L + 1), take(t.first, L + 1);
  if (!sorted) take(t.order, n), std::memcpy(t.order, k.order, n * sizeof(uint32_t));
  take(t.pixel, n), take(a, n), take(T, n), take(tau, n);
  uint32_t at = 0;
  for (uint32_t i = 0; i < L; i++) {
    const uint32_t l = sorted ? k.perm[i] : i, from = k.first[l], count = k.first[l + 1] - from;
    t.piece[i] = k.layer[l].piece, t.slot[i] = k.layer[l].slot, t.first[i] = at;
    for (uint32_t f = 0; f < count; f += VL) {  // what goes beyond the layer's end is written again by the next
      store(a + at + f, load(k.a + from + f)), store(T + at + f, load(k.T + from + f)), store(tau + at + f, load(k.t + from + f));
      narrow(t.pixel + at + f, load(k.px + from + f));
    }
    at += count;
  }
  t.first[L] = at;
  t.tau = tau, t.a = a, t.T = T, t.end = p;
}

SIMD bool plain_background(const Job<real> &J) { return J.background_row == 0 && J.background_pixel == 0; }

template <int N> SIMD void stream_row(real *out, const real *row, bool aligned) {
  for (int x = 0; x < N; x += VL) stream(out + x, load(row + x), aligned);
}
// Calls fill(y, color, alpha, depth, aligned) for the rows of a tile. It writes TILE pixels, past the caches where lines are whole: the next to
// read them is another program part, if any. Where the image ends within them, the rows lie elsewhere, and what is needed is copied.
template <class Fill> SIMD void write_rows(const Job<real> &J, const Place &p, Fill fill) {
  size_t at = pixel_index(J, p, 0);
  real *color = J.color + 3 * at, *alpha = J.alpha + at, *depth = J.depth + at;
  const int width = J.width;  // here and below in variables of their own: what is streamed might change J for all the compiler knows
  if (p.w == TILE && width % VL == 0) {
    for (int y = 0; y < p.h; y++, color += 3 * width, alpha += width, depth += width) fill(y, color, alpha, depth, true);
    return;
  }
  alignas(64) real spare[5 * TILE];
  for (int y = 0; y < p.h; y++, at += width, color += 3 * width, alpha += width, depth += width) {
    if (p.w == TILE) {
      fill(y, color, alpha, depth, at % VL == 0);  // the images themselves are aligned
      continue;
    }
    fill(y, spare, spare + 3 * TILE, spare + 4 * TILE, false);
    std::memcpy(color, spare, 3 * p.w * sizeof(real));
    std::memcpy(alpha, spare + 3 * TILE, p.w * sizeof(real)), std::memcpy(depth, spare + 4 * TILE, p.w * sizeof(real));
  }
}

// Colours of a row over a picture: of each pixel color(x, c, background).
template <class Color> SIMD void row_over_picture(const Job<real> &J, const Place &p, int y, real *out, bool aligned, Color color) {
  alignas(64) real row[3 * TILE];
  const real *bg = background_at(J, p, y);
  for (int x = 0; x < p.w; x++, bg += J.background_pixel)
    for (int c = 0; c < 3; c++) row[3 * x + c] = color(x, c, bg[c]);
  stream_row<3 * TILE>(out, row, aligned);
}
SIMD vf plain_color(const Job<real> &J, const Place &p) {
  const real *bg = background_at(J, p, 0);
  return tile4(v4{bg[0], bg[1], bg[2], 0});
}
SIMD bool in_registers(const Job<real> &J) { return VL >= 4 && plain_background(J); }
// VL colours, from four vectors of (r, g, b, -).
SIMD void stream_color(real *out, const vf *v, bool aligned) {
  stream(out, triples<0>(v[0], v[1]), aligned), stream(out + VL, triples<1>(v[1], v[2]), aligned),
      stream(out + 2 * VL, triples<2>(v[2], v[3]), aligned);
}

PHASE void write_empty(const Job<real> &J, const Place &p) {
  const bool plain = in_registers(J);
  const vf one = plain_color(J, p), colors[3] = {triples<0>(one, one), triples<1>(one, one), triples<2>(one, one)};
  write_rows(J, p, [&](int y, real *color, real *alpha, real *depth, bool aligned) SIMD_LAMBDA {
    if (!plain) row_over_picture(J, p, y, color, aligned, [](int, int, real background) { return background; });
    for (int x = 0; x < TILE; x += VL) {
      for (int i = 0; plain && i < 3; i++) stream(color + 3 * x + i * VL, colors[i], aligned);
      stream(alpha + x, vf{}, aligned), stream(depth + x, vf{}, aligned);
    }
  });
}

// Colour over the background, alpha and mean depth from k.pix = sum T a (r, g, b, depth), k.ink = sum T a and k.run = what shows of the background.
PHASE void write_tile(const Job<real> &J, const Place &p, Work &k) {
  const bool registers = in_registers(J);
  if (!registers)
    for (int i = 0; i < PIX; i++) k.depth[i] = k.pix[i][3];
  const vf plain = plain_color(J, p);
  write_rows(J, p, [&](int y, real *color, real *alpha, real *depth, bool aligned) SIMD_LAMBDA {
    const int row = y * TILE;
    if (!registers)
      row_over_picture(J, p, y, color, aligned, [&](int x, int c, real background) { return k.pix[row + x][c] + k.run[row + x] * background; });
    for (int x = 0; x < TILE; x += VL) {
      const vf run = load(k.run + row + x), ink = load(k.ink + row + x);
      vf sum = load(k.depth + row + x);
      if (registers) {
        const real *pix = (const real *)(k.pix + row + x);
        vf v[4] = {load(pix), load(pix + VL), load(pix + 2 * VL), load(pix + 3 * VL)};
        sum = fourths(v);
        v[0] += repeat4<0>(run) * plain, v[1] += repeat4<1>(run) * plain, v[2] += repeat4<2>(run) * plain, v[3] += repeat4<3>(run) * plain;
        stream_color(color + 3 * x, v, aligned);
      }
      stream(alpha + x, ink, aligned), stream(depth + x, select(ink > real(MIN_ALPHA), sum / ink, vf{}), aligned);
    }
  });
}
}  // namespace
}  // namespace stroke
