// The closest points of triangles in space, as shape/nearest.py finds them.
#pragma once
#include <algorithm>
#include <cmath>

namespace stroke::boxes {
struct Vector {
  double x, y, z;
  explicit Vector(const double *p) : x(p[0]), y(p[1]), z(p[2]) {}
  Vector(double x, double y, double z) : x(x), y(y), z(z) {}
  Vector operator-(const Vector &o) const { return {x - o.x, y - o.y, z - o.z}; }
  Vector operator+(const Vector &o) const { return {x + o.x, y + o.y, z + o.z}; }
  Vector operator*(double s) const { return {x * s, y * s, z * s}; }
  double dot(const Vector &o) const { return x * o.x + y * o.y + z * o.z; }
  double length() const { return std::sqrt(dot(*this)); }
};

// The share of the way from a to b at which the segment is closest to a point.
inline double share_of_segment(const Vector &p, const Vector &a, const Vector &b) {
  const Vector way = b - a;
  const double length = way.dot(way);
  return std::clamp((p - a).dot(way) / (length > 0 ? length : 1.0), 0.0, 1.0);
}

// The barycentric coordinates of the closest point of a triangle, nine numbers.
inline void closest_on_triangle(const Vector &p, const double *corners, double *shares) {
  const Vector corner[3] = {Vector(corners), Vector(corners + 3), Vector(corners + 6)};
  const Vector u = corner[1] - corner[0], v = corner[2] - corner[0], w = p - corner[0];
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), wu = w.dot(u), wv = w.dot(v), det = uu * vv - uv * uv;
  if (det > 0) {
    const double s = (vv * wu - uv * wv) / det, t = (uu * wv - uv * wu) / det;
    shares[0] = 1 - s - t, shares[1] = s, shares[2] = t;
    if (shares[0] >= 0 && s >= 0 && t >= 0) return;
  }
  double best = INFINITY;
  for (int k = 0; k < 3; k++) {
    const Vector &a = corner[k], &b = corner[(k + 1) % 3];
    const double share = share_of_segment(p, a, b), distance = (p - (a + (b - a) * share)).length();
    if (!(distance < best)) continue;
    best = distance;
    shares[k] = 1 - share, shares[(k + 1) % 3] = share, shares[(k + 2) % 3] = 0;
  }
}
}  // namespace stroke::boxes
