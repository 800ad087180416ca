// What of polygons' edges is the border of what a rule fills, row by row of pixels, between neighbouring heights at which edges end or cross.
#pragma once
#include "common/areas/chains.h"

namespace stroke::areas {
constexpr double THIN = 1e-12;  // slabs thinner than this, in pixels, are left out; and edges that are no further apart do not cross
constexpr double TOUCH = 1e-9;  // edges that are no further apart lie on each other

// Part of an edge, from the top to the bottom, with what is filled to the right of it (sign 1) or to the left (-1).
struct Border {
  int edge, sign;
  double x0, y0, x1, y1;
};
struct Chain {
  int first, end, sign;     // its pieces
  int here, since, border;  // the piece at the height that is looked at; that from which on it has been a border, and of which sign (0: none)
  double top, bottom, since_height;
};

// Shell's sort, which needs no memory, with the gaps of Ciura (2001) and beyond; few are sorted by insertion, which leaves equals in their order.
template <class T, class Less> APART void sort(T *a, int n, Less less) {
  constexpr int GAPS[] = {1, 23, 57, 132, 301, 701, 1577, 3548, 7983, 17961, 40412, 90927, 204585};
  int g = 12;
  while (g && 2 * GAPS[g] > n) g--;
  for (; g >= 0; g--)
    for (int i = GAPS[g]; i < n; i++) {
      const T x = a[i];
      int j = i;
      for (; j >= GAPS[g] && less(x, a[j - GAPS[g]]); j -= GAPS[g]) a[j] = a[j - GAPS[g]];
      a[j] = x;
    }
}

// One row at a time. Lists are vectors where memory grows, and parts of an array where it was measured: each is as long as the row has pieces, but
// `heights`, which has two a chain and what `crossings` finds.
template <template <class> class List> struct Sweep {
  List<Piece> pieces;
  List<Chain> chains;
  List<double> heights, keys;
  List<int> active, by_left;

  void clear() { pieces.clear(), chains.clear(), heights.clear(), active.clear(); }
  void chain(const Polygons &polygons, int head, double top, double bottom) {
    Chain c = {};
    c.first = int(pieces.size());
    walk(polygons, head, top, bottom, [&](Piece p, int sign) {
      c.sign = sign, p.chain = int(chains.size());
      pieces.push_back(p);
    });
    c.end = int(pieces.size());
    if (c.first == c.end) return;
    c.top = pieces[c.first].top, c.bottom = pieces[c.end - 1].bottom;
    chains.push_back(c);
  }
  // Pieces from the left to the right, for `crossings`.
  void order() {
    const int n = int(pieces.size());
    by_left.resize(n), keys.resize(n);
    for (int i = 0; i < n; i++) by_left[i] = i, keys[i] = min(pieces[i].x, pieces[i].at(pieces[i].bottom));
    sort(by_left.data(), n, [&](int i, int j) { return keys[i] < keys[j]; });
  }
  // visit(height) where pieces of two chains cross or touch.
  template <class Visit> void crossings(Visit visit) const {
    const int n = int(pieces.size());
    for (int a = 0; a < n; a++) {
      const Piece &p = pieces[by_left[a]];
      const double right = max(p.x, p.at(p.bottom)) + THIN;
      for (int b = a + 1; b < n && keys[by_left[b]] <= right; b++) {
        const Piece &q = pieces[by_left[b]];
        const double start = max(p.top, q.top), end = min(p.bottom, q.bottom);
        if (end <= start || p.chain == q.chain) continue;
        const double before = p.at(start) - q.at(start), behind = p.at(end) - q.at(end);
        if (abs(before) <= THIN || abs(behind) <= THIN) visit(start), visit(end);
        else if (before * behind < 0) visit(start + (end - start) * before / (before - behind));
      }
    }
  }
  // All heights between which nothing changes.
  void slabs() {
    for (int i = 0; i < int(chains.size()); i++) heights.push_back(chains[i].top), heights.push_back(chains[i].bottom);
    crossings([&](double height) { heights.push_back(height); });
    sort(heights.data(), int(heights.size()), [](double a, double b) { return a < b; });
    sort(chains.data(), int(chains.size()), [](const Chain &c, const Chain &d) { return c.top < d.top; });
  }
  // visit(border) for all borders of the row.
  template <class Visit> void borders(int rule, Visit visit) {
    for (int i = 0; i < int(chains.size()); i++) chains[i].here = chains[i].first, chains[i].border = 0;
    active.clear();
    int next = 0;
    for (int h = 0; h + 1 < int(heights.size()); h++) {
      const double start = heights[h], end = heights[h + 1];
      if (end - start <= THIN) continue;
      for (; next < int(chains.size()) && chains[next].top <= start; next++) active.push_back(next);
      const int count = advance(start, end, visit);
      // What lies on each other is one border, or none.
      int winding = 0;
      bool filled = false;
      for (int i = 0, to; i < count; i = to) {
        for (to = i; to < count && keys[to] <= keys[i] + TOUCH; to++) winding += chains[active[to]].sign;
        const bool now = rule == EVEN_ODD ? winding & 1 : winding != 0;
        for (int j = i; j < to; j++) becomes(chains[active[j]], j + 1 == to ? int(now) - int(filled) : 0, start, visit);
        filled = now;
      }
    }
    for (int i = 0; i < int(active.size()); i++) becomes(chains[active[i]], 0, chains[active[i]].bottom, visit);
  }

private:
  // Chains that reach a slab's end, from the left to the right; those that do not are over. Returns how many there are.
  template <class Visit> int advance(double start, double end, Visit &visit) {
    const double middle = start + (end - start) / 2;
    keys.resize(active.size());
    int count = 0;
    for (int k = 0; k < int(active.size()); k++) {
      const int i = active[k];
      Chain &c = chains[i];
      if (c.bottom < end) {
        becomes(c, 0, c.bottom, visit);
        continue;
      }
      while (c.here + 1 < c.end && pieces[c.here].bottom <= start) c.here++;
      int at = c.here;
      while (at + 1 < c.end && pieces[at].bottom < middle) at++;
      const double key = pieces[at].at(middle);
      int j = count++;
      for (; j && keys[j - 1] > key; j--) keys[j] = keys[j - 1], active[j] = active[j - 1];
      keys[j] = key, active[j] = i;
    }
    active.resize(count);
    return count;
  }
  // What the chain is from a height on; what it was before is told.
  template <class Visit> APART void becomes(Chain &c, int border, double height, Visit &visit) {
    if (border == c.border) return;
    if (c.border)
      for (int i = c.since; i < c.end && pieces[i].top < height; i++) {
        const Piece &p = pieces[i];
        const double start = max(p.top, c.since_height), end = min(p.bottom, height);
        if (end > start) visit(Border{p.edge, c.border, p.at(start), start, p.at(end), end});
      }
    c.border = border, c.since = c.here, c.since_height = height;
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
    const double column = rising || x0 == x1 ? floor(x) : ceil(x) - 1;
    const bool last = x0 == x1 || (rising ? x1 <= column + 1 : x1 >= column);
    double to = rising ? column + 1 : column;
    bool end = last;
    int at;
    if (column < 0) {  // all of it at once
      at = -1, to = 0, end = !rising || x1 <= 0;
    } else if (column >= width) {
      at = width, to = width, end = rising || x0 == x1 || x1 >= width;
    } else at = int(column);
    const double to_x = end ? x1 : to, to_y = end ? y1 : clamp(y0 + (to - x0) * slope, y, y1);
    if (at < width) cell(at, x, y, to_x, to_y);
    if (end) return;
    x = to_x, y = to_y;
  }
}

// The columns of pixels that a row's borders cross: nothing left or right of them changes there.
struct Reach {
  double low = 1e300, high = -1e300;
  void add(const Border &b) { low = min(low, min(b.x0, b.x1)), high = max(high, max(b.x0, b.x1)); }
  int left(int width) const { return int(clamp(floor(low), 0.0, double(width))); }
  int right(int width) const { return most(left(width), int(clamp(floor(high) + 1, 0.0, double(width)))); }
};

// Adds the area that a border bounds to a row of sums, which the coverage of pixels adds up: in its own pixel what lies right of it, in all further
// right its height. sums: of column `left` first.
template <class T> void add_area(const Border &border, int width, int left, T *sums) {
  columns(border, width, [&](int column, double xa, double ya, double xb, double yb) {
    const double height = border.sign * (yb - ya), right = column < 0 ? 0 : height * ((xa + xb) / 2 - column);
    sums[(column < 0 ? 0 : column) - left] += height - right, sums[column + 1 - left] += right;
  });
}

// The coverage of a pixel changes by what its border there sweeps over. Adds to the gradients of the ends of the border's edge; g_shares: of the
// coverages from column `left` on.
template <class S>
void back_to_ends(const Border &border, const Vertex &upper, const Vertex &lower, int width, int left, const S *g_shares, double *g_upper,
                  double *g_lower) {
  const double top = upper.y, length = lower.y - top;
  columns(border, width, [&](int column, double xa, double ya, double xb, double yb) {
    if (column < 0) return;
    const double weight = -border.sign * double(g_shares[column - left]), share = ((ya + yb) / 2 - top) / length;
    const double across = weight * (yb - ya), along = -weight * (xb - xa);
    g_upper[0] += (1 - share) * across, g_upper[1] += (1 - share) * along;
    g_lower[0] += share * across, g_lower[1] += share * along;
  });
}
}  // namespace stroke::areas
