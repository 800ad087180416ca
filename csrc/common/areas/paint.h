// Colours of a layer: one, or a gradient along a line or from a centre; and gradients back. As painting.py has it.
#pragma once
#include "common/areas/segment.h"

namespace stroke::areas {
struct Color {  // straight, and alpha
  double c[4];
  double &operator[](int k) { return c[k]; }
  double operator[](int k) const { return c[k]; }
};

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
    p.before = most(stop, 0), p.behind = least(stop + 1, stops - 1);
    p.gap = double(offsets_[p.behind]) - double(offsets_[p.before]);
    const bool between = p.before != p.behind && stop >= 0 && p.gap > 0;
    if (!between) p.behind = p.before;
    p.share = between ? (p.along - double(offsets_[p.before])) / p.gap : 0;
    return p;
  }

public:
  int row, first, stops, transform;

  Paint(const Tables<S> &tables, int paint) : row(paint) {
    const int *p = tables.paints + 4 * paint;
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
    for (int k = 0; k < 2; k++) {
      const double gk = k ? g_pixel.y : g_pixel.x;
      transform[3 * k] -= gk * p.at.x, transform[3 * k + 1] -= gk * p.at.y, transform[3 * k + 2] -= gk;
    }
  }
};

// A pixel while layers are painted: straight colour, colour times alpha, alpha, and what anything covers. As painting.py has it.
struct Pixel {
  double straight[3], color[3], alpha, all;
  // Alpha, in what is covered already, of a paint over it.
  double over(const Color &c) const { return c[3] * all + (1 - c[3]) * alpha; }
  double mixed(int k, const Color &c, double over) const { return over > 0 ? (c[3] * all * c[k] + (1 - c[3]) * color[k]) / over : 0; }
  void paint(double share, const Color &c) {
    const double opaque = share * c[3], weight = over(c);
    for (int k = 0; k < 3; k++) {
      straight[k] += share * (all * mixed(k, c, weight) + (c[3] > 0 ? (1 - all) * c[k] : 0) - straight[k]);
      color[k] += opaque * (c[k] - color[k]);
    }
    alpha += opaque * (1 - alpha), all += share * (1 - all);
  }
  // Of the share, and of the paint (c), to the gradient of the pixel before from that of the pixel after.
  double backward(double share, const Color &c, Pixel &g, Color &g_color) const {
    const double opaque = share * c[3], weight = over(c), rest = c[3] > 0 ? 1 : 0;
    double g_opaque = g.alpha * (1 - alpha), g_share = g.all * (1 - all), g_all = 0, g_over = 0;
    g_color[3] = 0;
    for (int k = 0; k < 3; k++) {
      const double x = mixed(k, c, weight), up = share * g.straight[k], g_x = weight > 0 ? all * up / weight : 0;
      g_share += g.straight[k] * (all * x + rest * (1 - all) * c[k] - straight[k]);
      g_opaque += g.color[k] * (c[k] - color[k]);
      g_color[k] = opaque * g.color[k] + rest * (1 - all) * up + c[3] * all * g_x;
      g_color[3] += g_x * (all * c[k] - color[k]);
      g_all += up * (x - rest * c[k]) + g_x * c[3] * c[k];
      g_over -= g_x * x;
      g.straight[k] *= 1 - share;
      g.color[k] = (1 - opaque) * g.color[k] + (1 - c[3]) * g_x;
    }
    g_color[3] += share * g_opaque + g_over * (all - alpha);
    g.alpha = (1 - opaque) * g.alpha + (1 - c[3]) * g_over;
    g.all = (1 - share) * g.all + g_all + c[3] * g_over;
    return g_share + c[3] * g_opaque;
  }
};
}  // namespace stroke::areas
