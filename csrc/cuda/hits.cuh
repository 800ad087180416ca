// From the strokes of a tile to its fragments, one thread for every point: the nearest point of each stroke within reach, kept per warp, and
// each point's fragments sorted by depth: the first half of occlusion; composite.cuh blends them.
#pragma once
#include "cuda/sort.cuh"
#include "cuda/tile.cuh"

namespace stroke {
// A stroke over a point; tile piece: NONE if it does not reach it.
struct Hit {
  real tau, a, z;
  u32 tile_piece;
};

// Nearest of some chords to a point, R2 if out of reach, and the nearest that is no neighbour of it: the curve may come near twice.
struct Nearest {
  real d2, tau, second, second_tau;
};
template <int WIDTH, bool TWO>
__device__ Nearest nearest_chords(const Job &J, const Piece<real> &piece, u32 first, u32 last, const Tile &p, real x, real y, real R2) {
  Nearest n = {R2, 0, R2, 0};
  u32 at = NONE;
  for (u32 i = first; i < last; i++) {
    const u32 index = J.tile_list[i];
    const Chord<real> c = J.chords[index];
    real s;
    const real d2 = chord_dist2<WIDTH>(piece, c, real(p.x) - c.ax + x, real(p.y) - c.ay + y, s), tau = chord_tau(c, s);
    const bool nearer = d2 < n.d2;
    if (TWO) {
      // What comes second: this chord, or the one that it beats.
      const real rest = nearer ? n.d2 : d2;
      if (at != NONE && index > at + 1 && rest < n.second) n.second = rest, n.second_tau = nearer ? n.tau : tau;
    }
    if (nearer) n.d2 = d2, n.tau = tau, at = index;
  }
  return n;
}

// The point (x, y) of a tile relative to a piece, where distances are measured.
struct Query {
  real x, y;
};
template <int WIDTH> __device__ Query query(const Piece<real> &c, const Tile &p, real x, real y) {
  Query q = {real(p.x) - c.ox + x, real(p.y) - c.oy + y};
  to_square<WIDTH>(c, q.x, q.y);
  return q;
}
// The nearest point of a piece from a chord's parameter, roughly, as a candidate among others.
struct Candidate {
  real d2, tau;
  u32 tile_piece;
};
__device__ inline void improve(const Piece<real> &c, u32 tile_piece, real start, const Query &q, Candidate &best) {
  const Point<real> point = arrive(c, newton_step(c, start, q.x, q.y), q.x, q.y, true, real(ROUGH_STEP));
  const real d2 = distance2(point, q.x, q.y);
  if (d2 < best.d2) best = {d2, point.tau, tile_piece};
}

// Where an end of the piece, at this chord, may be the nearest point of a bend, improves on the best from there; where it is what the chords
// say, from the middle of the chord. Neither is so where the point (x, y) lies farther to one side of the end than the chord turns.
template <int WIDTH>
__device__ void improve_at_end(const Job &J, u32 chord, bool stop, const Tile &p, real x, real y, const Nearest &n, const Piece<real> &piece,
                               u32 tile_piece, real R, Candidate &best) {
  const Chord<real> c = J.chords[chord];
  const ChordInfo info = J.chord_info[chord];
  const real end = stop ? real(.5) : real(-.5);
  if ((stop ? c.tau0 + c.dtau : c.tau0) != end || info.turn * float(R) < BENT_END * info.length) return;
  real ex = real(p.x) - c.ax + x - (stop ? c.ex : real(0)), ey = real(p.y) - c.ay + y - (stop ? c.ey : real(0)), ahead_x = c.ex, ahead_y = c.ey;
  to_square<WIDTH>(piece, ex, ey), to_square<WIDTH>(piece, ahead_x, ahead_y);
  const real d2 = ex * ex + ey * ey, along = (ex * ahead_x + ey * ahead_y) * (stop ? real(-1) : real(1));
  const real limit = sqrt(n.d2) + real(2 * CHORD_TOL);
  const bool found = n.tau == end;
  if (!(d2 < limit * limit && d2 < R * R && (found ? -along : along) < real(info.turn) * info.length * sqrt(d2))) return;
  improve(piece, tile_piece, found ? chord_tau(c, real(.5)) : end, query<WIDTH>(piece, p, x, y), best);
}

__device__ inline u32 tile_piece_end(const Job &J, const Tile &p, u32 tile_piece) {
  return tile_piece + 1 < p.tile_piece_last ? J.tile_pieces[tile_piece + 1].first : J.tile_first[p.index + 1];
}

// Where to begin on one stroke, of which the tile has the tile pieces first .. last: the nearest point so far.
template <int WIDTH> __device__ Candidate nearest_start(const Job &J, const Tile &p, u32 first, u32 last, real x, real y, real R) {
  Candidate best = {real(1e30), 0, NONE};
  for (u32 r = first; r < last; r++) {
    const TilePiece tile_piece = J.tile_pieces[r];
    const u32 end = tile_piece_end(J, p, r);
    const Piece<real> &c = J.pieces[tile_piece.piece];
    if (last - first == 1 && tile_piece.smooth) {
      const Nearest n = nearest_chords<WIDTH, false>(J, c, tile_piece.first, end, p, x, y, R * R);
      return {n.d2, n.tau, n.d2 < R * R ? r : NONE};
    }
    const Nearest n = nearest_chords<WIDTH, true>(J, c, tile_piece.first, end, p, x, y, R * R);
    if (!(n.d2 < R * R)) continue;
    const real limit = sqrt(n.d2) + real(2 * CHORD_TOL);  // chords this much farther may still lead to the nearest point
    const bool two = n.second < limit * limit && n.second < R * R;
    const Query q = query<WIDTH>(c, p, x, y);
    improve(c, r, n.tau, q, best);
    if (two) improve(c, r, n.second_tau, q, best);
    improve_at_end<WIDTH>(J, J.tile_list[tile_piece.first], false, p, x, y, n, c, r, R, best);
    improve_at_end<WIDTH>(J, J.tile_list[end - 1], true, p, x, y, n, c, r, R, best);
  }
  return best;
}

// uncovered: strokes within reach that do not cover the point count as well.
template <int WIDTH> __device__ Hit nearest_hit(const Job &J, const Tile &p, u32 first, u32 last, real x, real y, bool uncovered) {
  const Candidate start = nearest_start<WIDTH>(J, p, first, last, x, y, J.reach[J.tile_pieces[first].stroke]);
  if (start.tile_piece == NONE) return {0, 0, 0, NONE};
  const Piece<real> &c = J.pieces[J.tile_pieces[start.tile_piece].piece];
  const Query q = query<WIDTH>(c, p, x, y);
  const Point<real> point = arrive(c, newton_step(c, start.tau, q.x, q.y), q.x, q.y, true);
  const Fragment<real> g = fragment_at<WIDTH>(c, filter_of(J), point.tau, point.z, sqrt(distance2(point, q.x, q.y)), q.x, q.y);
  // Monte Carlo: a point is inside or not.
  const real a = J.strata ? (g.d < g.r ? real(1) : real(0)) : g.coverage;
  // Less depth is rounding: strokes are clipped at twice as much.
  return {point.tau, a * c.opacity, g.depth, (a > 0 || uncovered) && g.depth > real(J.near / 2) ? start.tile_piece : NONE};
}

// Memory for the fragments of a warp, taken in chunks: fewer atomic additions, at the price of some that stay empty.
constexpr u32 CHUNK = 128;
struct Pool {
  Cover *fragments;
  u32 *order;
  WarpFragments *warp_fragments;  // of the tile's tile pieces
  u64 *counter, *ordered;
  u64 limit, at;
  u32 left;
  // Room for n fragments, n <= 32; NONE if there is none. What finds no room is counted as what does: the host then knows how much it takes.
  __device__ u32 take(u32 n) {
    if (left < n) {
      u64 start = 0;
      if (lane() == 0) start = atomicAdd(counter, u64(CHUNK));
      at = __shfl_sync(ALL, start, 0), left = CHUNK;
    }
    left -= n, at += n;
    return at <= limit ? u32(at - n) : NONE;
  }
};

// The fragments of this thread's point, relative to the tile, if `active`: their number, and in `first` where their order begins. accept: which
// hits count. All threads of the block call this together.
template <int WIDTH, class Accept>
__device__ u32 collect(const Job &J, const Tile &p, real x, real y, bool active, Pool &pool, u32 &first, Accept accept, bool uncovered = false) {
  __shared__ ShortLists lists;
  const u32 warp = threadIdx.x / WARP;
  u32 n = 0;
  for (u32 r = p.tile_piece_first, next; r < p.tile_piece_last; r = next) {
    for (next = r + 1; next < p.tile_piece_last && J.tile_pieces[next].stroke == J.tile_pieces[r].stroke;) next++;
    Hit hit = {0, 0, 0, NONE};
    if (active) hit = nearest_hit<WIDTH>(J, p, r, next, x, y, uncovered);
    if (hit.tile_piece != NONE && !accept(hit)) hit.tile_piece = NONE;
    for (u32 k = r; k < next; k++) {
      const bool in = hit.tile_piece == k;
      u32 mask = __ballot_sync(ALL, in);
      const u32 start = mask ? pool.take(__popc(mask)) : 0;
      if (start == NONE) mask = 0;
      if (lane() == 0) pool.warp_fragments[u64(k - p.tile_piece_first) * WARPS + warp] = {start, mask};
      if (!in || !mask) continue;
      const u32 at = start + __popc(below(mask));
      pool.fragments[at] = {hit.tau, hit.a, hit.z, J.tile_pieces[k].piece};
      insert(lists, n++, hit.z, at);
    }
  }
  __syncwarp();
  u32 total;
  const u32 before = warp_prefix(n, total);
  u64 start = 0;
  if (lane() == 0 && total) start = atomicAdd(pool.ordered, u64(total));
  first = u32(__shfl_sync(ALL, start, 0)) + before;
  u32 *order = pool.order + first;
  for (u32 k = 0; k < n && n <= SHORT_LIST; k++) order[k] = lists.fragment[k][threadIdx.x];
  if (n > SHORT_LIST) {
    u32 k = 0;
    for (u32 r = p.tile_piece_first; r < p.tile_piece_last; r++) {
      const WarpFragments s = pool.warp_fragments[u64(r - p.tile_piece_first) * WARPS + warp];
      if (s.mask >> lane() & 1) order[k++] = s.first + __popc(below(s.mask));
    }
  }
  __syncwarp();
  for (u32 mask = __ballot_sync(ALL, n > SHORT_LIST); mask; mask &= mask - 1) {
    const u32 of = __ffs(mask) - 1;
    sort_long(lists, pool.order + __shfl_sync(ALL, first, of), __shfl_sync(ALL, n, of), pool.fragments);
  }
  __syncwarp();
  return n;
}
}  // namespace stroke
