// Colours of a layer: one, or a gradient along a line or from a centre; and gradients back. As painting.py has it.
#pragma once
#include "cpu/areas/polygons.h"
#include <array>

namespace stroke::areas {
using Color = std::array<double, 4>;  // straight, and alpha

template <class S> class Paint {
  enum Kind { PLAIN, LINEAR, RADIAL } kind_;
  const S *offsets_, *colors_, *axes_;
  Matrix there_ = {};  // from pixels to the coordinates of the axes

  Color stop(int i) const { return {double(colors_[4 * i]), double(colors_[4 * i + 1]), double(colors_[4 * i + 2]), double(colors_[4 * i + 3])}; }

  // Where a pixel is along the gradient, between which stops, and by what share.
  struct Place {
    Point at;
    double along;
    int before, behind;
    double gap, share;
  };
  Place place(double px, double py) const {
    Place p;
    p.at = there_({px, py});
    const Point a = {double(axes_[0]), double(axes_[1])}, b = {double(axes_[2]), double(axes_[3])};
    if (kind_ == LINEAR) {
      p.along = dot(p.at - a, b - a) / dot(b - a, b - a);
    } else {
      const Point q = p.at - a;
      p.along = norm({q.x / b.x, q.y / b.y});
    }
    int stop = -1;
    while (stop + 1 < stops && p.along >= double(offsets_[stop + 1])) stop++;
    p.before = std::max(stop, 0), p.behind = std::min(stop + 1, stops - 1);
    p.gap = double(offsets_[p.behind]) - double(offsets_[p.before]);
    const bool between = p.before != p.behind && stop >= 0 && p.gap > 0;
    if (!between) p.behind = p.before;
    p.share = between ? (p.along - double(offsets_[p.before])) / p.gap : 0;
    return p;
  }

public:
  int row, first, stops, transform;

  Paint(const Tables<S> &tables, int paint) : row(paint) {
    const int32_t *p = tables.paints + 4 * paint;
    kind_ = Kind(p[0]), first = p[1], stops = p[2], transform = p[3];
    offsets_ = tables.offsets + first, colors_ = tables.colors + 4 * first, axes_ = tables.axes + 4 * paint;
    if (plain()) return;
    const Matrix m = Matrix::of(tables.transforms + 6 * transform);
    const double det = m.xx * m.yy - m.xy * m.yx;
    there_ = {m.yy / det, -m.xy / det, 0, -m.yx / det, m.xx / det, 0};
    const Point origin = there_({m.x, m.y});
    there_.x = -origin.x, there_.y = -origin.y;
  }
  bool plain() const { return kind_ == PLAIN; }
  Color color() const { return stop(0); }
  // At the middle of a pixel.
  Color color(int x, int y) const {
    const Place p = place(x + 0.5, y + 0.5);
    Color a = stop(p.before), b = stop(p.behind);
    for (int k = 0; k < 4; k++) a[k] += p.share * (b[k] - a[k]);
    return a;
  }
  // Gradients of: colours of the stops, their offsets, axes, transform.
  int parameters() const { return plain() ? 4 : 5 * stops + 10; }
  void backward(const Color &g, double *out) const {
    for (int k = 0; k < 4; k++) out[k] += g[k];
  }
  void backward(int x, int y, const Color &g, double *out) const {
    const Place p = place(x + 0.5, y + 0.5);
    double g_share = 0;
    const Color before = stop(p.before), behind = stop(p.behind);
    for (int k = 0; k < 4; k++) {
      out[4 * p.before + k] += (1 - p.share) * g[k];
      out[4 * p.behind + k] += p.share * g[k];
      g_share += (behind[k] - before[k]) * g[k];
    }
    if (p.before == p.behind) return;
    double *offsets = out + 4 * stops, *axes = offsets + stops, *transform = axes + 4;
    const double g_along = g_share / p.gap;
    offsets[p.before] += (p.share - 1) * g_along, offsets[p.behind] -= p.share * g_along;
    const Point a = {double(axes_[0]), double(axes_[1])}, b = {double(axes_[2]), double(axes_[3])}, q = p.at - a;
    Point g_at, g_b;
    if (kind_ == LINEAR) {
      const Point d = b - a;
      const double square = dot(d, d);
      g_at = (g_along / square) * d;
      g_b = (g_along / square) * (q - (2 * p.along) * d);
      axes[0] -= g_at.x + g_b.x, axes[1] -= g_at.y + g_b.y;
    } else {
      if (p.along <= 0) return;
      g_at = (g_along / p.along) * Point{q.x / (b.x * b.x), q.y / (b.y * b.y)};
      g_b = {-g_at.x * q.x / b.x, -g_at.y * q.y / b.y};
      axes[0] -= g_at.x, axes[1] -= g_at.y;
    }
    axes[2] += g_b.x, axes[3] += g_b.y;
    // there = M^-1 (pixel - m): its change is -M^-1 (dM there + dm).
    const Point g_pixel = there_.transposed(g_at);
    for (int k : {0, 1}) {
      const double gk = k ? g_pixel.y : g_pixel.x;
      transform[3 * k] -= gk * p.at.x, transform[3 * k + 1] -= gk * p.at.y, transform[3 * k + 2] -= gk;
    }
  }
};
}  // namespace stroke::areas
