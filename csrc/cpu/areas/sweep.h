// What of polygons' edges is the border of what a rule fills, row by row of pixels, between neighbouring heights at which edges end or cross.
#pragma once
#include "cpu/areas/polygons.h"

namespace stroke::areas {
constexpr double THIN = 1e-12;  // slabs thinner than this, in pixels, are left out; and edges that are no further apart do not cross

// The edges of each row of pixels, as numbers in one list.
struct Rows {
  int first = 0, count = 0;  // rows of the picture
  std::vector<int> begin, edges;

  template <class S> Rows(const Polygons<S> &polygons, int height) {
    double low = height, high = 0;
    for (const Vertex &v : polygons.vertices) low = std::min(low, v.y), high = std::max(high, v.y);
    first = int(std::clamp(std::floor(low), 0.0, double(height)));
    count = std::max(int(std::clamp(std::ceil(high), 0.0, double(height))) - first, 0);
    begin.assign(count + 1, 0);
    for (int fill : {0, 1}) {
      for (int e = 0; e < int(polygons.edges.size()); e++) {
        const double a = polygons.vertices[polygons.edges[e].a].y, b = polygons.vertices[polygons.edges[e].b].y;
        if (a == b) continue;
        const double top = std::max(std::floor(std::min(a, b)) - first, 0.0), end = std::min(std::ceil(std::max(a, b)) - first, double(count));
        for (int row = int(top); row < end; row++)
          if (fill) edges[begin[row]++] = e;
          else begin[row]++;
      }
      if (fill) break;
      int sum = 0;
      for (int &b : begin) b = sum += b;
      edges.resize(sum);
      // Starts of rows; filling moves each to its end, which is the next row's start.
      for (int row = count; row > 0; row--) begin[row] = begin[row - 1];
      begin[0] = 0;
    }
    for (int row = count; row > 0; row--) begin[row] = begin[row - 1];
    if (count) begin[0] = 0;
  }
};

// One row at a time; memory is kept from row to row.
class Sweep {
  struct Piece {
    double top, bottom, x, slope;  // within the row; x and its change a pixel down, of the line at height `top`
    int edge, sign;
    double at(double y) const { return x + (y - top) * slope; }
  };
  std::vector<Piece> pieces_;
  std::vector<double> heights_, keys_;
  std::vector<int> active_, by_left_;

  void crossings() {
    const int n = int(pieces_.size());
    by_left_.resize(n);
    keys_.resize(n);
    for (int i = 0; i < n; i++) by_left_[i] = i, keys_[i] = std::min(pieces_[i].x, pieces_[i].at(pieces_[i].bottom));
    std::sort(by_left_.begin(), by_left_.end(), [&](int i, int j) { return keys_[i] < keys_[j]; });
    for (int a = 0; a < n; a++) {
      const Piece &p = pieces_[by_left_[a]];
      const double right = std::max(p.x, p.at(p.bottom));
      for (int b = a + 1; b < n && keys_[by_left_[b]] <= right; b++) {
        const Piece &q = pieces_[by_left_[b]];
        const double start = std::max(p.top, q.top), end = std::min(p.bottom, q.bottom);
        if (end <= start) continue;
        const double before = p.at(start) - q.at(start), behind = p.at(end) - q.at(end);
        if (before * behind < 0 && std::abs(before) > THIN && std::abs(behind) > THIN)
          heights_.push_back(start + (end - start) * before / (before - behind));
      }
    }
  }

public:
  double left = 0, right = 0;  // of the row's edges

  // visit(edge, sign, x0, y0, x1, y1): a border from the top to the bottom, with what is filled to the right of it (sign 1) or to the left (-1).
  template <class S, class Visit> void row(const Polygons<S> &polygons, const Rows &rows, int index, int rule, Visit visit) {
    const double top = rows.first + index, bottom = top + 1;
    pieces_.clear(), heights_.clear(), active_.clear();
    left = 1e300, right = -1e300;
    for (int k = rows.begin[index]; k < rows.begin[index + 1]; k++) {
      const Edge e = polygons.edges[rows.edges[k]];
      const Vertex *a = &polygons.vertices[e.a], *b = &polygons.vertices[e.b];
      const int sign = a->y < b->y ? 1 : -1;
      if (sign < 0) std::swap(a, b);
      const double start = std::max(a->y, top), end = std::min(b->y, bottom), slope = (b->x - a->x) / (b->y - a->y);
      if (end <= start) continue;
      const Piece p = {start, end, start == a->y ? a->x : a->x + (start - a->y) * slope, slope, rows.edges[k], sign};
      pieces_.push_back(p);
      heights_.push_back(start), heights_.push_back(end);
      const double x0 = p.x, x1 = p.at(end);
      left = std::min({left, x0, x1}), right = std::max({right, x0, x1});
    }
    crossings();
    std::sort(heights_.begin(), heights_.end());
    std::sort(pieces_.begin(), pieces_.end(), [](const Piece &p, const Piece &q) { return p.top < q.top; });
    size_t next = 0;
    for (size_t h = 0; h + 1 < heights_.size(); h++) {
      const double start = heights_[h], end = heights_[h + 1];
      if (end - start <= THIN) continue;
      for (; next < pieces_.size() && pieces_[next].top <= start; next++) active_.push_back(int(next));
      std::erase_if(active_, [&](int i) { return pieces_[i].bottom < end; });
      const double middle = start + (end - start) / 2;
      keys_.resize(active_.size());
      for (size_t i = 0; i < active_.size(); i++) {
        const int piece = active_[i];
        const double key = pieces_[piece].at(middle);
        size_t j = i;
        for (; j && keys_[j - 1] > key; j--) keys_[j] = keys_[j - 1], active_[j] = active_[j - 1];
        keys_[j] = key, active_[j] = piece;
      }
      int winding = 0;
      bool filled = false;
      for (int i : active_) {
        const Piece &p = pieces_[i];
        winding += p.sign;
        const bool now = rule == EVEN_ODD ? winding & 1 : winding != 0;
        if (now != filled) visit(p.edge, now ? 1 : -1, p.at(start), start, p.at(end), end);
        filled = now;
      }
    }
  }
};

// cell(column, x0, y0, x1, y1) for what of a line lies in each column of pixels of a row; what lies left of the picture as column -1, and what lies
// right of it not at all.
template <class Cell> void columns(double x0, double y0, double x1, double y1, int width, Cell cell) {
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
