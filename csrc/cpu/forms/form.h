// Planes, cylinders, cones, spheres and tori, as form/form_kinds.py has them: how far points are from them, and fits.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace stroke::forms {
// As FormKind has them.
enum Kind { PLANE, CYLINDER, SPHERE, CONE, TORUS };
// As form_kinds.py: what a distance from an axis is at least, steps of a fit, and the residuals, in scales, that count nothing.
constexpr double TINY = 1e-12, OUTLIER = 3;
constexpr int STEPS = 12;
// Numbers that a fit moves: the centre, two turns of the axis, the radius, the angle, the ring.
constexpr int NUMBERS = 8;

inline double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

struct Form {
  Kind kind;
  double center[3], axis[3], radius, angle, ring;
};

// The distance of points at the height h along the axis and at the distance q from it, and how it grows with both.
template <Kind KIND> struct Profile {
  double radius, ring, cos, sin;
  explicit Profile(const Form &f) : radius(f.radius), ring(f.ring), cos(std::cos(f.angle)), sin(std::sin(f.angle)) {}
  double operator()(double q, double h, double &gq, double &gh) const {
    if constexpr (KIND == PLANE) return gq = 0, gh = 1, h;
    else if constexpr (KIND == CYLINDER) return gq = 1, gh = 0, q - radius;
    else if constexpr (KIND == CONE) return gq = cos, gh = -sin, q * cos - h * sin - radius;
    else {
      const double out = q - ring, far = std::max(std::sqrt(out * out + h * h), TINY);
      return gq = out / far, gh = h / far, far - radius;
    }
  }
};

// f(profile) of the form's kind.
template <class F> auto with_profile(const Form &form, F &&f) {
  switch (form.kind) {
  case PLANE:
    return f(Profile<PLANE>(form));
  case CYLINDER:
    return f(Profile<CYLINDER>(form));
  case CONE:
    return f(Profile<CONE>(form));
  default:
    return f(Profile<TORUS>(form));
  }
}

// Distances of points, and cosines of the angles between normals and how they grow. Coordinates are a row each.
inline void measure(const Form &f, const double *const *points, const double *const *normals, size_t count, double *distance, double *cosine) {
  const double *x = points[0], *y = points[1], *z = points[2], *nx = normals[0], *ny = normals[1], *nz = normals[2];
  with_profile(f, [=, &f](const auto &profile) {
    const double c0 = f.center[0], c1 = f.center[1], c2 = f.center[2], a0 = f.axis[0], a1 = f.axis[1], a2 = f.axis[2];
    for (size_t s = 0; s < count; s++) {
      const double u0 = x[s] - c0, u1 = y[s] - c1, u2 = z[s] - c2, h = u0 * a0 + u1 * a1 + u2 * a2;
      const double w0 = u0 - h * a0, w1 = u1 - h * a1, w2 = u2 - h * a2, q = std::max(std::sqrt(w0 * w0 + w1 * w1 + w2 * w2), TINY);
      double gq, gh;
      distance[s] = profile(q, h, gq, gh);
      cosine[s] = gq * (w0 * nx[s] + w1 * ny[s] + w2 * nz[s]) / q + gh * (a0 * nx[s] + a1 * ny[s] + a2 * nz[s]);
    }
  });
}

// Two unit vectors across an axis and each other.
inline void frame(const double *axis, double (*across)[3]) {
  const double x = axis[0], y = axis[1], z = axis[2], least = std::min({std::abs(x), std::abs(y), std::abs(z)});
  double *a = across[0];
  if (std::abs(x) == least) a[0] = 0, a[1] = z, a[2] = -y;
  else if (std::abs(y) == least) a[0] = -z, a[1] = 0, a[2] = x;
  else a[0] = y, a[1] = -x, a[2] = 0;
  const double length = std::max(std::sqrt(dot(a, a)), TINY);
  for (int k = 0; k < 3; k++) a[k] /= length;
  for (int k = 0; k < 3; k++) across[1][k] = axis[(k + 1) % 3] * a[(k + 2) % 3] - axis[(k + 2) % 3] * a[(k + 1) % 3];
}

// Solves a system in place, by elimination with pivots; one without a solution gives numbers that are none.
inline void solve(double (*matrix)[NUMBERS], double *right, int n) {
  for (int k = 0; k < n; k++) {
    int pivot = k;
    for (int i = k + 1; i < n; i++)
      if (std::abs(matrix[i][k]) > std::abs(matrix[pivot][k])) pivot = i;
    std::swap_ranges(matrix[k], matrix[k] + n, matrix[pivot]), std::swap(right[k], right[pivot]);
    for (int i = k + 1; i < n; i++) {
      const double share = matrix[i][k] / matrix[k][k];
      for (int j = k; j < n; j++) matrix[i][j] -= share * matrix[k][j];
      right[i] -= share * right[k];
    }
  }
  for (int k = n; k-- > 0;) {
    for (int j = k + 1; j < n; j++) right[k] -= matrix[k][j] * right[j];
    right[k] /= matrix[k][k];
  }
}

// The square and what is right of it in the equations of a step, in the frame of across and axis.
inline void normal_equations(const Form &f, const double (*across)[3], const double *points, size_t count, double outlier, double (*matrix)[NUMBERS],
                             double *right) {
  with_profile(f, [&](const auto &profile) {
    for (size_t s = 0; s < count; s++) {
      const double *p = points + 3 * s, u[3] = {p[0] - f.center[0], p[1] - f.center[1], p[2] - f.center[2]};
      const double a = dot(across[0], u), b = dot(across[1], u), h = dot(f.axis, u), q = std::max(std::sqrt(a * a + b * b), TINY);
      const double ea = a / q, eb = b / q;
      double gq, gh;
      const double distance = profile(q, h, gq, gh), off = distance / outlier, weight = std::max(1 - off * off, 0.0);
      double row[NUMBERS] = {-gq * ea, -gq * eb, -gh, gh * a - gq * h * ea, gh * b - gq * h * eb, -1, 0, -gq};
      if (f.kind == CONE) row[6] = -q * profile.sin - h * profile.cos;
      for (double &number : row) number *= weight;
      for (int i = 0; i < NUMBERS; i++) {
        for (int j = 0; j < NUMBERS; j++) matrix[i][j] += row[i] * row[j];
        right[i] -= row[i] * weight * distance;
      }
    }
  });
}

// The form nearest to points, by least squares of which outliers have no part; only the numbers that are named move.
inline void fit(Form &f, const double *points, size_t count, double scale, const int *free, int n, double size, double settled) {
  for (int round = 0; round < STEPS; round++) {
    double across[2][3], all[NUMBERS][NUMBERS] = {}, all_right[NUMBERS] = {}, matrix[NUMBERS][NUMBERS], right[NUMBERS], step[NUMBERS] = {};
    frame(f.axis, across);
    normal_equations(f, across, points, count, OUTLIER * scale, all, all_right);
    for (int i = 0; i < n; i++) {
      for (int j = 0; j < n; j++) matrix[i][j] = all[free[i]][free[j]];
      matrix[i][i] = matrix[i][i] * (1 + 1e-9) + 1e-12, right[i] = all_right[free[i]];
    }
    solve(matrix, right, n);
    double longest = 0;
    for (int i = 0; i < n; i++) step[free[i]] = right[i], longest = std::max(longest, std::abs(right[i]));
    // No step is longer than what the data can say something about.
    const double share = std::min(1.0, size / std::max(longest, TINY));
    for (double &number : step) number *= share;
    for (int k = 0; k < 3; k++) {
      f.center[k] += step[0] * across[0][k] + step[1] * across[1][k] + step[2] * f.axis[k];
      across[0][k] = f.axis[k] + step[3] * across[0][k] + step[4] * across[1][k];
    }
    const double length = std::max(std::sqrt(dot(across[0], across[0])), TINY);
    for (int k = 0; k < 3; k++) f.axis[k] = across[0][k] / length;
    f.radius += step[5], f.angle += step[6], f.ring = std::max(f.ring + step[7], 0.0);
    if (longest * share < settled * size) break;
  }
}
}  // namespace stroke::forms
