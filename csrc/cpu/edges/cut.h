// Rows of points cut into the cheapest lines, arcs and cubics, as edges/first/segment.py says.
#pragma once
#include "cpu/edges/solve.h"
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

namespace stroke::edges {
struct Cutting {
  double scatter, stray, rise;           // as segment.py has them; scatter and rise in world units
  double line, arc, cubic;               // what the free numbers of each cost
  double one_way, wavering, most_sweep;  // of arcs, as primitives.py has them
  double settled, even;                  // a step of a circle that changes nothing, and the pull of cubics
  int circle_rounds, cubic_rounds;

  // For each place the one at which the stroke that ends there begins in the cheapest sequence.
  std::vector<int64_t> cut(const double *points, const int64_t *places, size_t count) const {
    std::vector<double> cost(count, std::numeric_limits<double>::infinity()), least(count, 0);
    std::vector<int64_t> last(count, 0);
    std::vector<char> open(count, 1);
    Part part;
    cost[0] = 0;
    for (size_t stop = 1; stop < count; stop++) {
      for (size_t start = 0; start < stop; start++) {
        const size_t size = size_t(places[stop] - places[start]) + 1;
        const double left = cost[stop] - cost[start];
        if (!open[start] || (size < 3 && start > 0) || left <= line) continue;
        const double price = size < 4 ? line : best(points + 3 * places[start], size, left, part);
        if (cost[start] + price < cost[stop]) cost[stop] = cost[start] + price, last[stop] = int64_t(start);
        if (left > cubic) least[start] = cost[start] + price - cubic;
      }
      // Points only add to costs: a start that costs more here than other ways does so from here on.
      for (size_t start = 0; start < stop; start++) open[start] &= least[start] < cost[stop];
    }
    return last;
  }

private:
  // Of some points, as seen from their middle along their axes; and numbers of each.
  struct Part {
    std::vector<double> flat[3], t, off;
  };
  double off(double square) const { return std::min(square / (scatter * scatter), stray * stray); }

  // The cost of the cheapest single stroke; those of which the free numbers alone cost more are not fitted.
  double best(const double *points, size_t M, double below, Part &part) const {
    double cost = of_line(points, M, part);
    if (arc >= std::min(cost, below)) return cost;
    cost = std::min(cost, of_arc(M, part));
    if (cubic >= std::min(cost, below)) return cost;
    return std::min(cost, of_cubic(points, M, part));
  }
  double of_line(const double *points, size_t M, Part &part) const {
    double middle[3] = {}, axes[3][3];
    for (size_t k = 0; k < 3 * M; k++) middle[k % 3] += points[k] / double(M);
    Scatter scatter;
    for (auto &row : part.flat) row.resize(M);
    for (size_t k = 0; k < M; k++) {
      const double p[3] = {points[3 * k] - middle[0], points[3 * k + 1] - middle[1], points[3 * k + 2] - middle[2]};
      scatter.add(1, p);
    }
    scatter.axes(axes);
    double cost = line;
    for (size_t k = 0; k < M; k++) {
      const double p[3] = {points[3 * k] - middle[0], points[3 * k + 1] - middle[1], points[3 * k + 2] - middle[2]};
      for (int d = 0; d < 3; d++) part.flat[d][k] = dot(axes[d], p);
      cost += off(part.flat[1][k] * part.flat[1][k] + part.flat[2][k] * part.flat[2][k]);
    }
    return cost;
  }
  // After the line of the same points, which has found their axes.
  double of_arc(size_t M, Part &part) const {
    const double none = std::numeric_limits<double>::infinity(), n = double(M);
    const auto &[x, y, z] = part.flat;
    double xx = 0, yy = 0, xs = 0, ys = 0, squares = 0;
    for (size_t k = 0; k < M; k++) {
      const double square = x[k] * x[k] + y[k] * y[k];
      xx += x[k] * x[k], yy += y[k] * y[k], xs += x[k] * square, ys += y[k] * square, squares += square;
    }
    if (!(yy > 0)) return none;
    double cx = xs / xx / 2, cy = ys / yy / 2;
    const double bound = squares / n + cx * cx + cy * cy;
    if (!(bound > 0 && bound < 1e12)) return none;
    double radius = std::sqrt(bound);
    for (int round = 0; round < circle_rounds; round++) {
      double a = 0, b = 0, rho = 0, aa = 0, ab = 0, bb = 0, ra = 0, rb = 0;
      for (size_t k = 0; k < M; k++) {
        const double dx = x[k] - cx, dy = y[k] - cy, r = std::sqrt(dx * dx + dy * dy) + 1e-12, u = dx / r, v = dy / r;
        // As seen from the radius so far: differences of large numbers lose their digits.
        const double o = r - radius;
        a += u, b += v, rho += o, aa += u * u, ab += u * v, bb += v * v, ra += u * o, rb += v * o;
      }
      a /= n, b /= n, rho /= n, aa -= n * a * a, ab -= n * a * b, bb -= n * b * b, ra -= n * a * rho, rb -= n * b * rho;
      const double determinant = aa * bb - ab * ab;
      if (!(determinant > 0)) return none;
      const double step_x = (ra * bb - rb * ab) / determinant, step_y = (rb * aa - ra * ab) / determinant;
      const double wider = rho - a * step_x - b * step_y;
      cx += step_x, cy += step_y, radius += wider;
      if (std::max({std::abs(step_x), std::abs(step_y), std::abs(wider)}) < settled * radius) break;
    }
    if (!(radius > 0 && radius < none)) return none;
    double cost = arc, first = 0, angle = 0, low = none, high = -none;
    for (size_t k = 0; k < M; k++) {
      const double dx = x[k] - cx, dy = y[k] - cy, rise = std::sqrt(dx * dx + dy * dy) - radius, here = std::atan2(dy, dx);
      cost += off(rise * rise + z[k] * z[k]);
      angle = k ? angle + std::remainder(here - angle, 2 * std::numbers::pi) : first = here;
      low = std::min(low, angle), high = std::max(high, angle);
    }
    const double sweep = std::abs(angle - first);
    const bool bent = radius * (1 - std::cos(std::min(sweep, std::numbers::pi) / 2)) >= std::max(rise, 1e-6);
    return bent && high - low <= one_way * sweep + wavering && sweep <= most_sweep ? cost : none;
  }
  double of_cubic(const double *points, size_t M, Part &part) const {
    const double *first = points, *last = points + 3 * (M - 1), pull = even * double(M);
    auto &t = part.t, &squares = part.off;
    t.assign(M, 0), squares.resize(M);
    for (size_t k = 1; k < M; k++) {
      const double *p = points + 3 * k, step[3] = {p[0] - p[-3], p[1] - p[-2], p[2] - p[-1]};
      t[k] = t[k - 1] + std::sqrt(dot(step, step));
    }
    const double length = t[M - 1] > 0 ? t[M - 1] : 1;
    for (double &at : t) at /= length;
    for (int left = cubic_rounds;; left--) {
      double matrix[4][4] = {}, right[3][4] = {}, control[3][4];
      for (size_t k = 0; k < M; k++) {
        double b[4];
        bernstein(t[k], b);
        for (int i = 0; i < 4; i++) {
          for (int j = 0; j < 4; j++) matrix[i][j] += b[i] * b[j];
          for (int d = 0; d < 3; d++) right[d][i] += b[i] * (points[3 * k + d] - first[d]);
        }
      }
      for (int i = 0; i < 4; i++) matrix[i][i] += pull;
      for (int d = 0; d < 3; d++) {
        for (int i = 0; i < 4; i++) right[d][i] += pull * (last[d] - first[d]) * i / 3;
        solve(matrix, right[d], control[d]);
      }
      for (size_t k = 0; k < M; k++) {
        double b[4], s = 1 - t[k], toward = 0, speed = 0;
        bernstein(t[k], b);
        squares[k] = 0;
        for (int d = 0; d < 3; d++) {
          const double *c = control[d], away = points[3 * k + d] - first[d] - (b[0] * c[0] + b[1] * c[1] + b[2] * c[2] + b[3] * c[3]);
          const double tangent = 3 * (s * s * (c[1] - c[0]) + 2 * s * t[k] * (c[2] - c[1]) + t[k] * t[k] * (c[3] - c[2]));
          squares[k] += away * away, toward += away * tangent, speed += tangent * tangent;
        }
        if (left) t[k] = std::clamp(t[k] + toward / std::max(speed, 1e-12), 0.0, 1.0);
      }
      if (!left) break;
      t[0] = 0, t[M - 1] = 1;
    }
    double cost = cubic;
    for (double square : squares) cost += off(square);
    return cost;
  }
  static void bernstein(double t, double *b) {
    const double s = 1 - t;
    b[0] = s * s * s, b[1] = 3 * s * s * t, b[2] = 3 * s * t * t, b[3] = t * t * t;
  }
};
}  // namespace stroke::edges
