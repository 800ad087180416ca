// Which points of lines another line appears beside, as edges/evidence/support.py says.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace stroke::edges {
struct Point {
  double pixel[2], heading[2], place[3], along[3];
  int64_t number;
};

// The points of a picture by their cells of a grid, hashed.
class Crowd {
  double side_, slant_, apart_;
  size_t mask_ = 1;
  std::vector<size_t> start_;
  std::vector<Point> points_;

  size_t slot(double column, double row) const {
    const uint64_t cell = uint64_t(int64_t(column)) * 0x9E3779B97F4A7C15u + uint64_t(int64_t(row)) * 0xC2B2AE3D27D4EB4Fu;
    return size_t(cell >> 20) & mask_;
  }

public:
  // side: how far beside a point another counts, pixels. slant: the sine between lines that run the same way. apart: the square of how far apart
  // lines are that are two, world units.
  Crowd(const std::vector<Point> &points, double side, double slant, double apart) : side_(side), slant_(slant), apart_(apart) {
    while (mask_ < 2 * points.size()) mask_ = 2 * mask_ + 1;
    start_.assign(mask_ + 2, 0), points_.resize(points.size());
    std::vector<size_t> at;
    for (const Point &p : points) start_[at.emplace_back(slot(std::floor(p.pixel[0] / side), std::floor(p.pixel[1] / side))) + 1]++;
    for (size_t k = 0; k <= mask_; k++) start_[k + 1] += start_[k];
    std::vector<size_t> next(start_.begin(), start_.end() - 1);
    for (size_t k = 0; k < points.size(); k++) points_[next[at[k]]++] = points[k];
  }
  bool beside(const Point &p) const {
    const double column = std::floor(p.pixel[0] / side_), row = std::floor(p.pixel[1] / side_);
    for (int i = -1; i < 2; i++)
      for (int j = -1; j < 2; j++) {
        const size_t at = slot(column + i, row + j);
        for (size_t k = start_[at]; k < start_[at + 1]; k++)
          if (crowds(p, points_[k])) return true;
      }
    return false;
  }

private:
  static double square(const double *a, const double *b) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
  }
  bool crowds(const Point &p, const Point &other) const {
    const double x = p.pixel[0] - other.pixel[0], y = p.pixel[1] - other.pixel[1];
    // Most are of one line, or of two that are one.
    if (!(x * x + y * y <= side_ * side_ && square(p.place, other.place) > apart_)) return false;
    if (!(std::abs(p.heading[0] * other.heading[1] - p.heading[1] * other.heading[0]) < slant_)) return false;
    // Which of the two comes first says along which of them they are apart.
    const bool first = p.number < other.number;
    const double *a = first ? p.place : other.place, *b = first ? other.place : p.place, *along = first ? p.along : other.along;
    double on = 0;
    for (int k = 0; k < 3; k++) on += (a[k] - b[k]) * along[k];
    // Across the line: a line seen from its end is no other line.
    return square(a, b) - on * on > apart_;
  }
};
}  // namespace stroke::edges
