// The polygons of one layer, and for each row of pixels the edges with which chains begin there.
#pragma once
#include "common/areas/sweep.h"
#include <cstddef>
#include <vector>

namespace stroke::areas {
// Places along a segment, found once.
struct KeptAlong {
  Segment s;
  int segment, count;
  std::vector<Point> centers, tangents;
  std::vector<double> widths, bends;
  std::vector<char> turning;

  explicit KeptAlong(const Along &a)
      : s(a.s), segment(a.segment), count(a.count), centers(count + 1), tangents(count + 1), widths(count + 1), bends(count), turning(count + 1) {
    for (int k = 0; k <= count; k++) centers[k] = a.center(k), tangents[k] = a.tangent(k), widths[k] = a.width(k), turning[k] = a.turns(k);
    for (int k = 0; k < count; k++) bends[k] = between(tangents[k], tangents[k + 1]);
  }
  double t(int k) const { return double(k) / count; }
  Point center(int k) const { return centers[k]; }
  double width(int k) const { return widths[k]; }
  bool turns(int k) const { return turning[k]; }
  Point tangent(int k) const { return tangents[k]; }
  double bend(int k) const { return bends[k]; }
};

class LayerPolygons {
  Matrix matrix_;

  template <class S> static Segment segment(const Tables<S> &tables, int start, int points, int at, int inner) {
    Segment s;
    s.degree = inner + 1;
    for (int i = 0; i <= s.degree; i++) {
      const int k = s.index[i] = start + (at + i) % points;
      s.p[i] = {double(tables.points[2 * k]), double(tables.points[2 * k + 1])}, s.w[i] = double(tables.half_widths[k]);
    }
    return s;
  }

public:
  std::vector<Segment> segments;
  std::vector<Vertex> vertices;
  std::vector<Link> links;

  int reserve(int n) {
    const std::size_t first = vertices.size();
    vertices.resize(first + n), links.resize(first + n, {-1, -1});
    return int(first);
  }
  template <class F> void each(int n, F f) {
    for (int k = 0; k < n; k++) f(k);
  }
  template <class F> bool any(int n, F f) {
    for (int k = 0; k < n; k++)
      if (f(k)) return true;
    return false;
  }
  void put(int i, const Vertex &vertex) { vertices[i] = vertex; }
  void edge(int a, int b) { links[a].next = b, links[b].previous = a; }
  Polygons view() const { return {vertices.data(), links.data()}; }

  template <class S> LayerPolygons(const Tables<S> &tables, const int *layer) : matrix_(Matrix::of(tables.transforms + 6 * layer[3])) {
    Outliner<LayerPolygons> outliner(matrix_, *this);
    for (int contour = layer[0]; contour < layer[0] + layer[1]; contour++) {
      const int *c = tables.contours + 5 * contour;
      const int start = c[0], points = c[1], first = int(segments.size()), begin = int(vertices.size());
      if (!points) continue;
      for (int j = 0, at = 0; j < c[3]; j++) {
        segments.push_back(segment(tables, start, points, at, tables.inner[c[2] + j]));
        at += segments.back().degree;
      }
      if (!c[3]) segments.push_back(segment(tables, start, points, 0, -1));
      const int count = int(segments.size()) - first;
      auto given = [&](int i) -> const Segment & { return segments[i]; };
      auto kept = [](const Segment &s, int i, double scale) { return KeptAlong(Along(s, i, scale)); };
      for (int j = first; j < first + count; j++)
        if (layer[2] == STROKE) outliner.outline(j, first, count, c[4], given, kept);
        else outliner.fill(segments[j], j, first, count, begin);
    }
  }

  // From gradients of the vertices to those of each segment's control points, (4, 3) a segment, and of the transform.
  void backward(const double *g_vertices, double *g_controls, double *g_transform) const {
    for (std::size_t v = 0; v < vertices.size(); v++) {
      const int j = vertices[v].segment;
      back_to_controls(vertices[v], segments[j], matrix_, {g_vertices[2 * v], g_vertices[2 * v + 1]}, g_controls + 12 * j, g_transform);
    }
  }
};

struct Rows {
  int first = 0, count = 0;       // rows of the picture
  std::vector<int> begin, heads;  // of each row, and one more: its part of heads

  Rows(const LayerPolygons &polygons, int height) {
    double low = height, high = 0;
    for (const Vertex &v : polygons.vertices) low = min(low, v.y), high = max(high, v.y);
    first = int(clamp(floor(low), 0, height));
    count = most(int(clamp(ceil(high), 0, height)) - first, 0);
    // Counted first, then filled: begin is one place ahead, until filling has moved each start to its end.
    begin.assign(count + 2, 0);
    for (int fill = 0; fill < 2; fill++) {
      for (int e = 0; e < int(polygons.vertices.size()); e++) {
        const auto span = polygons.view().heads(e);
        const int top = int(clamp(span.first - first, 0, count)), end = int(clamp(span.end - first, 0, count));
        for (int k = top; k < end; k++)
          if (fill) heads[begin[k + 1]++] = e;
          else begin[k + 2]++;
      }
      if (fill) break;
      for (int k = 1; k < count + 2; k++) begin[k] += begin[k - 1];
      heads.resize(begin.back());
    }
  }
};
}  // namespace stroke::areas
