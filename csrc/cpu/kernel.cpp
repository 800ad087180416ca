// The tile kernels: compiled several times, with -DISA=... -DREAL=... and matching -m flags.
#include "cpu/simd.h"  // first: the templates of common/ find its operations on vectors
#include "cpu/analytic.h"
#include "cpu/montecarlo.h"

namespace stroke {
namespace {
void forward(const Job<real> &J, int tile, Scratch &S, Arena &A) {
  if (J.strata) J.world ? montecarlo_forward<true>(J, tile, S, A) : montecarlo_forward<false>(J, tile, S, A);
  else J.world ? analytic_forward<true>(J, tile, S, A) : analytic_forward<false>(J, tile, S, A);
}
void backward(const Job<real> &J, int tile, Scratch &S) {
  if (J.strata) montecarlo_backward(J, tile, S);
  else if (J.world) J.g_depth ? analytic_backward<true, true>(J, tile, S) : analytic_backward<true, false>(J, tile, S);
  else J.g_depth ? analytic_backward<false, true>(J, tile, S) : analytic_backward<false, false>(J, tile, S);
}
void outline_tile(const Job<real> &J, int tile, Scratch &S) { J.world ? outline_values<true>(J, tile, S) : outline_values<false>(J, tile, S); }
}  // namespace

#define TEXT2(x) #x
#define TEXT(x) TEXT2(x)
#define JOIN2(a, b) a##b
#define JOIN(a, b) JOIN2(a, b)
extern const Kernels<real> JOIN(kernels_, ISA);
const Kernels<real> JOIN(kernels_, ISA) = {forward, backward, outline_tile, outline_piece, TEXT(ISA)};
}  // namespace stroke
