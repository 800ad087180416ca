// Edges of polygons as chains that run downwards, cut at the rows of pixels.
#pragma once
#include "common/areas/contour.h"

namespace stroke::areas {
// The polygons of a layer.
struct Polygons {
  const Vertex *vertices;
  const Link *links;

  // The vertices of an edge from the top to the bottom; sign 1 if it is directed so, -1 if not, 0 for a level one and where there is no edge.
  struct Downwards {
    int upper, lower, sign;
  };
  Downwards downwards(int e) const {
    const int a = e, b = e < 0 ? -1 : links[e].next;
    if (b < 0) return {a, b, 0};
    const double ya = vertices[a].y, yb = vertices[b].y;
    return ya <= yb ? Downwards{a, b, ya < yb} : Downwards{b, a, -1};
  }
  // The edge that goes on downwards where one ends, or upwards where it begins; -1 if there is no such.
  int below(int e) const { return beside(e, 1); }
  int above(int e) const { return beside(e, -1); }
  // The rows of pixels in which a chain begins with this edge, from `first` up to `end`: all in which it is, but for one in which it goes on.
  struct Span {
    double first, end;
  };
  Span heads(int e) const {
    const auto [upper, lower, sign] = downwards(e);
    if (!sign) return {0, 0};
    const double y = vertices[upper].y, row = floor(y);
    return {row + (y > row && above(e) >= 0), ceil(vertices[lower].y)};
  }

private:
  int beside(int e, int way) const {
    const int sign = downwards(e).sign, other = sign == way ? links[e].next : links[e].previous;
    return sign && downwards(other).sign == sign ? other : -1;
  }
};

// Part of an edge within a row: from `top` to `bottom`; x and its change a pixel down, of the line at height `top`.
struct Piece {
  double top, bottom, x, slope;
  int edge, chain;
  double at(double y) const { return x + (y - top) * slope; }
};
// visit(piece, sign) for all of a chain in a row of pixels, from the top to the bottom.
template <class Visit> void walk(const Polygons &polygons, int head, double top, double bottom, Visit visit) {
  for (int e = head; e >= 0; e = polygons.below(e)) {
    const auto [upper, lower, sign] = polygons.downwards(e);
    const Vertex &a = polygons.vertices[upper], &b = polygons.vertices[lower];
    if (a.y >= bottom) break;
    const double start = max(a.y, top), end = min(b.y, bottom), slope = (b.x - a.x) / (b.y - a.y);
    if (end <= start) break;
    visit(Piece{start, end, a.x + (start - a.y) * slope, slope, e, 0}, sign);
  }
}
}  // namespace stroke::areas
