// One step of a point onto the edge near it, as edges/first/triangulate.py says: to the planes through the ridges that views show beside it.
#pragma once
#include "cpu/edges/solve.h"
#include "cpu/edges/views.h"
#include <vector>

namespace stroke::edges {
struct Settling {
  double sigma, within;           // pixels
  double tilt, damping, longest;  // as their names in Python
  int rounds;                     // of finding the direction
  bool known;                     // whether it is known about

  struct Plane {
    const double *normal;  // and offset
    double weight;
  };
  // Moves a point; what its direction is, and the sum of the planes' weights.
  double step(const Views<double> &views, const double *planes, double *x, double *axis, std::vector<Plane> &near) const {
    near.clear();
    for (size_t view = 0; view < views.count(); view++) {
      const auto match = views.match(view, x);
      if (match.ridge < 0 || !(match.square < within * within)) continue;
      near.push_back({planes + 4 * match.ridge, std::exp(-0.5 * match.square / (sigma * sigma))});
    }
    Scatter scatter;
    double axes[3][3];
    for (int round = 0; round < rounds; round++) {
      if (round || known)
        for (Plane &plane : near) {
          const double cosine = dot(plane.normal, axis) / tilt, along = 1 / (1 + cosine * cosine);
          plane.weight *= along * along;
        }
      scatter = {};
      for (const Plane &plane : near) scatter.add(plane.weight, plane.normal);
      scatter.axes(axes), std::copy_n(axes[2], 3, axis);
    }
    double score = 0, right[3] = {}, way[3];
    for (const Plane &plane : near) {
      const double residual = plane.weight * (dot(plane.normal, x) + plane.normal[3]);
      score += plane.weight;
      for (int k = 0; k < 3; k++) right[k] -= residual * plane.normal[k];
    }
    const double damp = damping * (scatter.m[0][0] + scatter.m[1][1] + scatter.m[2][2]) + 1e-9;
    for (int k = 0; k < 3; k++) scatter.m[k][k] += damp;
    solve(scatter.m, right, way);
    const double along = dot(way, axis);
    for (int k = 0; k < 3; k++) way[k] -= along * axis[k];
    const double limit = std::min(1.0, longest / std::max(std::sqrt(dot(way, way)), 1e-12));
    for (int k = 0; k < 3; k++) x[k] += limit * way[k];
    return score;
  }
};
}  // namespace stroke::edges
