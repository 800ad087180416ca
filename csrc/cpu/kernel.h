// Interface between the driver (driver.cpp, compiled for the baseline instruction set) and the tile kernels (kernel.cpp, compiled once per
// instruction set and precision).
#pragma once
#include "common/closest.h"
#include <cstddef>
#include <cstdint>

namespace stroke {
template <class S> struct Piece;
template <class S> struct Chord;
template <class S> struct Filter;
template <class S> struct OutlinePoint;

// Growing memory of one thread, in driver.cpp. grow: block `index` with at least `bytes`, its first `keep` bytes kept, 64-byte aligned.
struct Scratch;
char *grow(Scratch &, int index, size_t keep, size_t bytes);
constexpr int SCRATCH_BLOCKS = 15;
// Memory that stays with the thread, zeroed when new.
void *work_memory(Scratch &, size_t bytes);
// Memory that lives as long as the state of one call: 64-byte aligned, plus 64 bytes of slack.
struct Arena;
void *arena_take(Arena &, size_t bytes);

// About a chord: its piece, length in px and turning of the tangent in radians. `bend` accumulates the turning of the stroke, in front of
// the chord and behind it; gaps, ends of pieces and bends too tight count as SHARP.
struct ChordInfo {
  uint32_t piece;
  float bend_before, bend_after, length, turn;
};
constexpr float SHARP = 100;
// Whether a run of chords has one nearest point to anything within its reach (SMOOTH_TURN, common/closest.h).
inline bool smooth(const ChordInfo &first, const ChordInfo &last) { return last.bend_after - first.bend_before < SMOOTH_TURN; }

// Where one stroke meets one tile: its chords first .. last (inclusive) may reach it. They belong to `pieces` pieces from `piece` on, whose sums
// go to the slots from `slot` on. `smooth`: see above. A stroke that leaves a tile and comes back has several, one after the other.
struct Intersection {
  uint32_t stroke, first, last, piece, pieces, slot;
  bool smooth;
};

// Fragments of one tile that the forward keeps for the backward. A layer is one piece over the tile: fragments first[l] .. first[l+1],
// sums to slot[l]. order: fragments near to far per pixel; null where the layers lie in that order.
// tau, a, T: parameter, alpha and transmittance in front of each.
struct Tile {
  uint32_t layers, fragments;
  uint32_t *piece, *slot, *first, *order;
  void *tau, *a, *T;
  uint8_t *pixel;
  char *end;
};

template <class S> struct Job {
  int views, height, width, tiles_x, tiles_y;
  bool world, along, oblong, save;  // but for save: see Width
  Filter<S> filter;
  S min_depth;    // less depth than this is rounding: strokes are clipped at twice as much
  S chord_slack;  // px: chords this much farther than the nearest may still lead to the nearest point
  const Piece<S> *pieces;
  const uint32_t *piece_stroke;  // the row of the stroke
  const Chord<S> *chords;
  const ChordInfo *chord_info;
  const Intersection *intersections;  // and one more, with the number of slots
  const uint32_t *tile_first;         // offsets into intersections, one a tile
  const S *reach;                     // per stroke: no pixel farther than this is covered
  const S *background;                // (views, height, width, 3) by strides, innermost 1
  ptrdiff_t background_view, background_row, background_pixel;
  S *color, *alpha, *depth;
  Tile *tiles;  // one a tile and stratum
  // backward; any of the three may be null
  const S *g_color, *g_alpha, *g_depth;
  S *g_slot;        // (slots, NGRAD)
  S *g_square;      // (slots, 4), or null
  S *g_background;  // (views, height, width, 3), or null
  // Monte Carlo
  int strata;  // samples per pixel and direction; 0: analytic
  uint64_t seed;
  const OutlinePoint<S> *outline;                 // in the order of pieces
  const uint32_t *outline_order, *outline_first;  // the points of each tile
  S *g_outline;                                   // dL per normal displacement of each point
};

template <class S> struct Kernels {
  void (*forward)(const Job<S> &, int tile, Scratch &, Arena &);
  void (*backward)(const Job<S> &, int tile, Scratch &);
  void (*outline_tile)(const Job<S> &, int tile, Scratch &);                                      // g_outline of the points in the tile
  void (*outline_piece)(const Job<S> &, uint32_t piece, uint32_t first, uint32_t last, S *sums);  // their gradient, NGRAD numbers
  const char *isa;
};
}  // namespace stroke
