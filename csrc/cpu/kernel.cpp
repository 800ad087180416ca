// The tile kernels: compiled several times, with -DISA=... -DREAL=... and matching -m flags.
#include "cpu/simd.h"  // first: the templates of common/ find its operations on vectors
#include "cpu/analytic.h"
#include "cpu/montecarlo.h"

namespace stroke {
namespace {
void forward(const Job<real> &J, int tile, Scratch &S, Arena &A) {
  with_width(J.world, J.along, J.oblong, [&](auto width) {
    if (J.strata) montecarlo_forward<width>(J, tile, S, A);
    else analytic_forward<width>(J, tile, S, A);
  });
}
void backward(const Job<real> &J, int tile, Scratch &S) {
  if (J.strata) return J.oblong ? montecarlo_backward<OBLONG>(J, tile, S) : montecarlo_backward<EVEN>(J, tile, S);
  with_width(J.world, J.along, J.oblong,
             [&](auto width) { J.g_depth ? analytic_backward<width, true>(J, tile, S) : analytic_backward<width, false>(J, tile, S); });
}
void outline_tile(const Job<real> &J, int tile, Scratch &S) {
  with_width(J.world, J.along, J.oblong, [&](auto width) { outline_values<width>(J, tile, S); });
}
}  // namespace

#define TEXT2(x) #x
#define TEXT(x) TEXT2(x)
#define JOIN2(a, b) a##b
#define JOIN(a, b) JOIN2(a, b)
extern const Kernels<real> JOIN(kernels_, ISA);
const Kernels<real> JOIN(kernels_, ISA) = {forward, backward, outline_tile, outline_piece, TEXT(ISA)};
}  // namespace stroke
