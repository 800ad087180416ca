// Random numbers that depend on the seed and the place, not on the order of work.
#pragma once
#include "common/scalar.h"

namespace stroke {

// A hash with good avalanche (the constants of Wellons' search "lowbias32"), and 24 of its bits as a number in [0, 1).
HD unsigned mix(unsigned h) {
  h ^= h >> 16, h *= 0x7feb352du;
  h ^= h >> 15, h *= 0x846ca68bu;
  return h ^ h >> 16;
}
HD float unit(unsigned h) { return float(h >> 8) * 5.9604644775390625e-8f; }
}  // namespace stroke
