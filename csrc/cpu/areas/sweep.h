// What of polygons' edges is the border of what a rule fills, row by row of pixels, between neighbouring heights at which edges end or cross.
#pragma once
#include "cpu/areas/polygons.h"

namespace stroke::areas {
constexpr double THIN = 1e-12;  // slabs thinner than this, in pixels, are left out; and edges that are no further apart do not cross
constexpr double TOUCH = 1e-9;  // edges that are no further apart lie on each other

// Edges as chains that run downwards, and for each row of pixels the edges with which chains begin there.
struct Rows {
  int first = 0, count = 0;              // rows of the picture
  std::vector<int> begin, heads, below;  // below: the edge that goes on where one ends, -1 if there is no such

  template <class S> Rows(const Polygons<S> &polygons, int height) {
    double low = height, high = 0;
    for (const Vertex &v : polygons.vertices) low = std::min(low, v.y), high = std::max(high, v.y);
    first = int(std::clamp(std::floor(low), 0.0, double(height)));
    count = std::max(int(std::clamp(std::ceil(high), 0.0, double(height))) - first, 0);
    // Of each vertex: the only edge that comes to it from above; -1 if there is none, -2 if there are several. And below.
    const int edges = int(polygons.edges.size());
    std::vector<int> from(polygons.vertices.size(), -1), to(polygons.vertices.size(), -1);
    for (int e = 0; e < edges; e++) {
      const auto [upper, lower, sign] = polygons.downwards(e);
      if (!sign) continue;
      for (int *at : {&from[lower], &to[upper]}) *at = *at == -1 ? e : -2;
    }
    below.assign(edges, -1);
    std::vector<char> goes_on(edges);
    for (size_t v = 0; v < from.size(); v++)
      if (from[v] >= 0 && to[v] >= 0 && polygons.downwards(from[v]).sign == polygons.downwards(to[v]).sign)
        below[from[v]] = to[v], goes_on[to[v]] = 1;
    // Counted first, then filled: begin is one place ahead, until filling has moved each start to its end.
    begin.assign(count + 2, 0);
    for (int fill : {0, 1}) {
      for (int e = 0; e < edges; e++) {
        const auto [upper, lower, sign] = polygons.downwards(e);
        if (!sign) continue;
        const double y = polygons.vertices[upper].y, row = std::floor(y);
        const int top = int(std::max(row - first + (goes_on[e] && y > row), 0.0));
        const int end = int(std::min(std::ceil(polygons.vertices[lower].y) - first, double(count)));
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

// Part of an edge, from the top to the bottom, with what is filled to the right of it (sign 1) or to the left (-1).
struct Border {
  int edge, sign;
  double x0, y0, x1, y1;
};

// One row at a time; memory is kept from row to row.
class Sweep {
  struct Piece {
    double top, bottom, x, slope;  // within the row; x and its change a pixel down, of the line at height `top`
    int edge, chain;
    double at(double y) const { return x + (y - top) * slope; }
  };
  struct Chain {
    int first, end, sign;     // its pieces
    int here, since, border;  // the piece at the height that is looked at; that from which on it has been a border, and of which sign (0: none)
    double top, bottom, since_height;
  };
  std::vector<Piece> pieces_;
  std::vector<Chain> chains_;
  std::vector<double> heights_, keys_;
  std::vector<int> active_, by_left_;

  // Heights at which pieces of two chains cross or touch.
  void crossings() {
    const int n = int(pieces_.size());
    by_left_.resize(n), keys_.resize(n);
    for (int i = 0; i < n; i++) by_left_[i] = i, keys_[i] = std::min(pieces_[i].x, pieces_[i].at(pieces_[i].bottom));
    std::sort(by_left_.begin(), by_left_.end(), [&](int i, int j) { return keys_[i] < keys_[j]; });
    for (int a = 0; a < n; a++) {
      const Piece &p = pieces_[by_left_[a]];
      const double right = std::max(p.x, p.at(p.bottom)) + THIN;
      for (int b = a + 1; b < n && keys_[by_left_[b]] <= right; b++) {
        const Piece &q = pieces_[by_left_[b]];
        const double start = std::max(p.top, q.top), end = std::min(p.bottom, q.bottom);
        if (end <= start || p.chain == q.chain) continue;
        const double before = p.at(start) - q.at(start), behind = p.at(end) - q.at(end);
        if (std::abs(before) <= THIN || std::abs(behind) <= THIN) heights_.push_back(start), heights_.push_back(end);
        else if (before * behind < 0) heights_.push_back(start + (end - start) * before / (before - behind));
      }
    }
  }

  // What the chain is from a height on; what it was before is told.
  template <class Visit> void becomes(Chain &c, int border, double height, Visit &visit) {
    if (border == c.border) return;
    if (c.border)
      for (int i = c.since; i < c.end && pieces_[i].top < height; i++) {
        const Piece &p = pieces_[i];
        const double start = std::max(p.top, c.since_height), end = std::min(p.bottom, height);
        if (end > start) visit(Border{p.edge, c.border, p.at(start), start, p.at(end), end});
      }
    c.border = border, c.since = c.here, c.since_height = height;
  }

  template <class S> void chain(const Polygons<S> &polygons, const Rows &rows, int head, double top, double bottom) {
    Chain c = {};
    c.first = c.here = int(pieces_.size());
    for (int e = head; e >= 0; e = rows.below[e]) {
      const auto [upper, lower, sign] = polygons.downwards(e);
      const Vertex &a = polygons.vertices[upper], &b = polygons.vertices[lower];
      if (a.y >= bottom) break;
      const double start = std::max(a.y, top), end = std::min(b.y, bottom), slope = (b.x - a.x) / (b.y - a.y);
      if (end <= start) break;
      c.sign = sign;
      const Piece p = {start, end, a.x + (start - a.y) * slope, slope, e, int(chains_.size())};
      const double x0 = p.x, x1 = p.at(end);
      left = std::min({left, x0, x1}), right = std::max({right, x0, x1});
      pieces_.push_back(p);
    }
    c.end = int(pieces_.size());
    if (c.first == c.end) return;
    c.top = pieces_[c.first].top, c.bottom = pieces_.back().bottom;
    heights_.push_back(c.top), heights_.push_back(c.bottom);
    chains_.push_back(c);
  }

public:
  double left = 0, right = 0;  // of the row's edges

  // visit(border) for all borders of a row.
  template <class S, class Visit> void row(const Polygons<S> &polygons, const Rows &rows, int index, int rule, Visit visit) {
    pieces_.clear(), chains_.clear(), heights_.clear(), active_.clear();
    left = 1e300, right = -1e300;
    for (int k = rows.begin[index]; k < rows.begin[index + 1]; k++) chain(polygons, rows, rows.heads[k], rows.first + index, rows.first + index + 1);
    crossings();
    std::sort(heights_.begin(), heights_.end());
    std::sort(chains_.begin(), chains_.end(), [](const Chain &c, const Chain &d) { return c.top < d.top; });
    size_t next = 0;
    for (size_t h = 0; h + 1 < heights_.size(); h++) {
      const double start = heights_[h], end = heights_[h + 1];
      if (end - start <= THIN) continue;
      for (; next < chains_.size() && chains_[next].top <= start; next++) active_.push_back(int(next));
      const double middle = start + (end - start) / 2;
      keys_.resize(active_.size());
      size_t count = 0;
      for (int i : active_) {
        Chain &c = chains_[i];
        if (c.bottom < end) {
          becomes(c, 0, c.bottom, visit);
          continue;
        }
        while (c.here + 1 < c.end && pieces_[c.here].bottom <= start) c.here++;
        int at = c.here;
        while (at + 1 < c.end && pieces_[at].bottom < middle) at++;
        const double key = pieces_[at].at(middle);
        size_t j = count++;
        for (; j && keys_[j - 1] > key; j--) keys_[j] = keys_[j - 1], active_[j] = active_[j - 1];
        keys_[j] = key, active_[j] = i;
      }
      active_.resize(count);
      // What lies on each other is one border, or none.
      int winding = 0;
      bool filled = false;
      for (size_t i = 0, to; i < count; i = to) {
        for (to = i; to < count && keys_[to] <= keys_[i] + TOUCH; to++) winding += chains_[active_[to]].sign;
        const bool now = rule == EVEN_ODD ? winding & 1 : winding != 0;
        for (size_t j = i; j < to; j++) becomes(chains_[active_[j]], j + 1 == to ? int(now) - int(filled) : 0, start, visit);
        filled = now;
      }
    }
    for (int i : active_) becomes(chains_[i], 0, chains_[i].bottom, visit);
  }
};

// cell(column, x0, y0, x1, y1) for what of a border lies in each column of pixels of a row; what lies left of the picture as column -1, and what lies
// right of it not at all.
template <class Cell> void columns(const Border &border, int width, Cell cell) {
  const auto [edge, sign, x0, y0, x1, y1] = border;
  const double slope = x1 != x0 ? (y1 - y0) / (x1 - x0) : 0;
  const bool rising = x1 > x0;
  double x = x0, y = y0;
  while (true) {
    const double column = rising || x0 == x1 ? std::floor(x) : std::ceil(x) - 1;
    const bool last = x0 == x1 || (rising ? x1 <= column + 1 : x1 >= column);
    double to = rising ? column + 1 : column;
    bool end = last;
    int at;
    if (column < 0) {  // all of it at once
      at = -1, to = 0, end = !rising || x1 <= 0;
    } else if (column >= width) {
      at = width, to = width, end = rising || x0 == x1 || x1 >= width;
    } else at = int(column);
    const double to_x = end ? x1 : to, to_y = end ? y1 : std::clamp(y0 + (to - x0) * slope, y, y1);
    if (at < width) cell(at, x, y, to_x, to_y);
    if (end) return;
    x = to_x, y = to_y;
  }
}
}  // namespace stroke::areas
