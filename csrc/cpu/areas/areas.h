// Filled and stroked contours painted over each other, by exact areas of pixels; forward and backward, in double precision, over threads.
#pragma once
#include "common/areas/paint.h"
#include "cpu/areas/polygons.h"
#include "cpu/memory.h"
#include <memory>

namespace stroke::areas {
// How much of each pixel a layer covers: in each of its rows a run of pixels, all in one list.
template <class S> struct Coverage {
  int first = 0;
  struct Run {
    int left, right;
    size_t start, borders;  // in the lists; borders of a row end where those of the next begin
  };
  std::vector<Run> runs;
  std::vector<S> shares;
  std::vector<Border> borders;  // for gradients only
  // The run in a row of the picture, if there is one.
  const Run *at(int row) const {
    const int k = row - first;
    return k >= 0 && k < int(runs.size()) && runs[k].left < runs[k].right ? &runs[k] : nullptr;
  }
};

template <class S> struct Layer {
  LayerPolygons polygons;
  int rule;
  Paint<S> paint;
  Coverage<S> coverage;
};

template <class S> struct State {
  Tables<S> tables;
  int width, height;
  const S *background;  // (height, width, 4), or none
  std::vector<std::shared_ptr<Layer<S>>> layers;
};

template <class S> struct Gradients {
  Buffer<S> points, half_widths, transforms, axes, offsets, colors, background;
};

// The pixels that each layer covers, and how much of each: those of a layer begin at `first`, which has one number more than there are layers.
template <class S> struct Covered {
  Buffer<int64_t> first, pixels;
  Buffer<S> shares;
};

// Fills state.layers, with what gradients need if that is saved.
template <class S> void cover(State<S> &state, bool save);
template <class S> Covered<S> covered(const State<S> &state);
// The picture, (height, width, 4); covers first.
template <class S> Buffer<S> draw(State<S> &state, bool save);
template <class S> Gradients<S> backward(const State<S> &state, const S *g_image, bool want_background);
}  // namespace stroke::areas
