// A tile of one view, and its pixels.
#pragma once
#include "cuda/job.cuh"

namespace stroke {
// Of the kernels with a block a tile, for 64 registers a thread. The compiler would have three with 80: on an H100 up to a sixth slower, but for the
// gradients of tens of strokes over every pixel (empirical).
constexpr int BLOCKS = 4;
// A tile of one view: corner and size inside the image, and the pieces over it.
struct Tile {
  u32 index;
  int view, x, y, w, h;
  u32 tile_piece_first, tile_piece_last;
};
__device__ inline Tile tile_at(const Job &J, u32 t) {
  const int x = int(t % J.tiles_x) * TILE, y = int(t / J.tiles_x % J.tiles_y) * TILE;
  const u32 first = fits(J, TILE_PIECES) ? J.tile_piece_first[t] : 0, tile_pieces = fits(J, TILE_PIECES) ? J.tile_piece_count[t] : 0;
  return {t,
          int(t / (J.tiles_x * J.tiles_y)),
          x,
          y,
          J.width - x < TILE ? J.width - x : TILE,
          J.height - y < TILE ? J.height - y : TILE,
          first,
          first + tile_pieces};
}
// The pixel of a thread in its tile: a warp has 8 x 4 of them, which fewer strokes touch than two rows.
__device__ inline int pixel_x(u32 thread) { return int(thread / WARP % 2 * 8 + thread % 8); }
__device__ inline int pixel_y(u32 thread) { return int(thread / WARP / 2 * 4 + thread % WARP / 8); }
__device__ inline u64 pixel_index(const Job &J, const Tile &p, int x, int y) { return (u64(p.view) * J.height + p.y + y) * J.width + p.x + x; }
__device__ inline const real *background_at(const Job &J, const Tile &p, int x, int y) {
  return J.background + p.view * J.background_view + (p.y + y) * J.background_row + (p.x + x) * J.background_pixel;
}
}  // namespace stroke
