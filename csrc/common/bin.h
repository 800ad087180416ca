// Binning: which tiles a chord may reach, for every driver.
#pragma once
#include "common/flatten.h"

namespace stroke {
// Calls f(tx, ty) for the tiles with points within R of the chord, `length` px long, or just beyond; row by row. anywhere: points may lie
// anywhere in pixels (samples), not only in their centres.
template <class S, class Visit> HD void visit_tiles(const Chord<S> &c, float length, float R, bool anywhere, int tiles_x, int tiles_y, Visit f) {
  const float half = TILE / 2 - (anywhere ? 0 : .5f), margin = TILE / 2 - half;  // from a tile's middle to its outer points; from these to its edge
  const float ax = float(c.ax), ay = float(c.ay), ex = float(c.ex), ey = float(c.ey);
  const float x0 = least(ax, ax + ex) - R + margin, x1 = most(ax, ax + ex) + R - margin;
  const float y0 = least(ay, ay + ey) - R + margin, y1 = most(ay, ay + ey) + R - margin;
  if (x1 < 0 || y1 < 0) return;
  auto tile_of = [](float x, int n) { return int(least(most(x * (1.f / TILE), 0.f), float(n))); };
  const int tx0 = tile_of(x0, tiles_x), tx1 = tile_of(x1, tiles_x - 1), ty0 = tile_of(y0, tiles_y), ty1 = tile_of(y1, tiles_y - 1);
  if (tx0 == tx1 || ty0 == ty1) {
    for (int ty = ty0; ty <= ty1; ty++)
      for (int tx = tx0; tx <= tx1; tx++) f(tx, ty);
    return;
  }
  // Of several rows and columns, tiles are skipped if none of their points lies in the band around the chord. The slack is for rounding.
  const float across = R * length + half * (abs(ex) + abs(ey)) + .01f;
  for (int ty = ty0; ty <= ty1; ty++)
    for (int tx = tx0; tx <= tx1; tx++) {
      const float cx = float(tx * TILE + TILE / 2), cy = float(ty * TILE + TILE / 2);
      if (abs(ex * (cy - ay) - ey * (cx - ax)) <= across) f(tx, ty);
    }
}
}  // namespace stroke
