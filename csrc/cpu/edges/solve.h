// Small symmetric matrices: their axes, and what they take to a vector.
#pragma once
#include <algorithm>
#include <cmath>
#include <utility>

namespace stroke::edges {
inline double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// What a positive definite matrix takes to b: Cholesky's factors.
template <int N> void solve(const double (&m)[N][N], const double (&b)[N], double (&x)[N]) {
  double l[N][N];
  for (int i = 0; i < N; i++)
    for (int j = 0; j <= i; j++) {
      double sum = m[i][j];
      for (int k = 0; k < j; k++) sum -= l[i][k] * l[j][k];
      l[i][j] = i == j ? std::sqrt(sum) : sum / l[j][j];
    }
  for (int i = 0; i < N; i++) {
    x[i] = b[i];
    for (int k = 0; k < i; k++) x[i] -= l[i][k] * x[k];
    x[i] /= l[i][i];
  }
  for (int i = N - 1; i >= 0; i--) {
    for (int k = i + 1; k < N; k++) x[i] -= l[k][i] * x[k];
    x[i] /= l[i][i];
  }
}

// A sum of products of vectors in space.
struct Scatter {
  double m[3][3] = {};

  void add(double weight, const double *n) {
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) m[i][j] += weight * n[i] * n[j];
  }
  // Its unit eigenvectors, that of the largest eigenvalue first: Jacobi's rotations.
  void axes(double (&out)[3][3]) const {
    double a[3][3], vectors[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    std::copy_n(&m[0][0], 9, &a[0][0]);
    // Each sweep about doubles the digits.
    for (int sweep = 0; sweep < 12 && (a[0][1] != 0 || a[0][2] != 0 || a[1][2] != 0); sweep++)
      for (const auto &[p, q] : {std::pair(0, 1), {0, 2}, {1, 2}}) {
        if (std::abs(a[p][q]) <= 1e-18 * (std::abs(a[p][p]) + std::abs(a[q][q]))) {
          a[p][q] = a[q][p] = 0;
          continue;
        }
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]), t = std::copysign(1 / (std::abs(theta) + std::sqrt(theta * theta + 1)), theta);
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        const int r = 3 - p - q;
        const double rp = a[r][p], rq = a[r][q];
        a[p][p] -= t * a[p][q], a[q][q] += t * a[p][q], a[p][q] = a[q][p] = 0;
        a[r][p] = a[p][r] = c * rp - s * rq, a[r][q] = a[q][r] = s * rp + c * rq;
        for (int k = 0; k < 3; k++) {
          const double vp = vectors[p][k], vq = vectors[q][k];
          vectors[p][k] = c * vp - s * vq, vectors[q][k] = s * vp + c * vq;
        }
      }
    int order[3] = {0, 1, 2};
    std::sort(order, order + 3, [&](int i, int j) { return a[i][i] > a[j][j]; });
    for (int k = 0; k < 3; k++) std::copy_n(vectors[order[k]], 3, out[k]);
  }
};
}  // namespace stroke::edges
