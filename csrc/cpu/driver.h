// One call on the CPU: rasterize rational Bézier strokes to images, and take gradients back.
#pragma once
#include "common/coverage.h"
#include "common/layout.h"
#include "cpu/flatten.h"
#include "cpu/threads.h"
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace stroke {

// A stroke that cannot be drawn; the caller knows how to say what is wrong with it.
struct InvalidStroke : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

// What a drawing needs besides tensors: `Options` of render/kernel_inputs.py field by field, bound by name in module.cpp.
struct Options {
  bool world, orthographic;
  double near, blur;
  int strata;  // samples per pixel and direction, 0: analytic
  uint64_t seed;
  double width_scale;   // half widths in pixels of a width of 1
  bool differ_squares;  // whether the gradient of Square is wanted
};

// Which segments make which stroke.
struct Chains {
  const int64_t *first;  // (strokes + 1): the first segment of each; null: every segment is a stroke
  const bool *closed;    // (strokes)
  int first_of(int n) const { return first ? int(first[n]) : n; }
};

template <class S> struct Input {
  Layout layout;
  int height, width;
  Chains chains;
  const double *cubics;  // (rows of segments, 4, 4)
  const S *half_width;   // (rows or number of strokes), in units of options.width_scale pixels; along: (rows or number of segments, 4)
  bool half_width_per_view, half_width_along;
  const S *color, *opacity;  // (strokes, 3), (strokes)
  const double *square;      // (views, 2, 2): Square of each view; null where all have square pixels
  const S *background;       // strides in elements, innermost 1
  ptrdiff_t background_view, background_row, background_pixel;
  Options options;
  const double *square_of(int view) const { return square ? square + 4 * size_t(view) : nullptr; }
};

template <class S> struct Images {
  Buffer<S> color, alpha, depth;
};

// null: no gradient
template <class S> struct Upstream {
  const S *color, *alpha, *depth;
};
template <class S> struct Gradients {
  Buffer<double> cubics;  // (rows of segments, 4, 4)
  Buffer<double> square;  // (views, 2, 2), where wanted: that of T of adjoint.h
  Buffer<S> half_width, color, opacity, background;
};

// What the forward leaves for the backward.
template <class S> struct State {
  Input<S> input;
  Job<S> job{};
  Flat<S> flat;
  struct StrokeIntersection {
    uint32_t tile, stroke, first, last, piece, pieces, intersection;
    bool smooth;
  };
  Buffer<S> reach;                                // of each view's strokes
  Buffer<double> scale;                           // of each view's segments
  List<StrokeIntersection> stroke_intersections;  // in the order of strokes; `intersection`: its place among those by tile
  Buffer<uint32_t> stroke_intersection_first, piece_stroke, tile_first;
  Buffer<uint32_t> piece_first;  // of each view's segments
  Buffer<Intersection> intersections;
  Buffer<Tile> tiles;
  std::vector<Arena> arenas;
  size_t fragments() const;
};

void set_threads(int n);
std::vector<std::string> instruction_sets();        // that this machine runs, best last
void set_instruction_set(const std::string &name);  // float32; double precision is compiled for the baseline only
std::string instruction_set();

// Both for callers that hold threads().busy().
template <class S> Images<S> forward(State<S> &state, bool save);
template <class S> Gradients<S> backward(const State<S> &state, const Upstream<S> &up, const S *alpha, const S *depth, bool background);
}  // namespace stroke
