// SIMD vectors of the widest size this translation unit is compiled for (GCC and Clang vector extensions; plain loops where no
// instruction set is known), and the operations that common/ needs on them. Include before all of common/.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>
#if defined(__x86_64__)
#include <immintrin.h>
#endif
#ifndef REAL
#define REAL float
#endif
#define SIMD inline __attribute__((always_inline))
#define SIMD_LAMBDA __attribute__((always_inline))

namespace stroke {
inline namespace ISA {  // a name of its own per instruction set: nothing for the linker to merge
using real = REAL;
constexpr bool F32 = sizeof(real) == 4;
#if defined(__AVX512F__)
constexpr int VBYTES = 64;
#elif defined(__AVX2__)
constexpr int VBYTES = 32;
#else
constexpr int VBYTES = 16;
#endif
constexpr int VL = VBYTES / int(sizeof(real));  // lanes
template <bool> struct IntOf {
  using type = int32_t;
};
template <> struct IntOf<false> {
  using type = int64_t;
};
using integer = IntOf<F32>::type;
typedef real vf __attribute__((vector_size(VBYTES)));
typedef integer vi __attribute__((vector_size(VBYTES)));
using Mask = unsigned;  // one bit a lane

SIMD vf splat(real x) { return x - vf{}; }
SIMD vi splat_int(integer x) { return x - vi{}; }
SIMD vf load(const real *p) {
  vf v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
SIMD void store(real *p, vf v) { std::memcpy(p, &v, sizeof v); }
SIMD vi load(const integer *p) {
  vi v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
SIMD void store(integer *p, vi v) { std::memcpy(p, &v, sizeof v); }
SIMD vi widen(const uint8_t *p) {  // bytes; __builtin_convertvector takes them one by one in GCC 12
#if defined(__AVX512F__)
  if constexpr (F32) return (vi)_mm512_cvtepu8_epi32(_mm_loadu_si128((const __m128i *)p));
#elif defined(__AVX2__)
  if constexpr (F32) return (vi)_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)p));
#elif defined(__SSE4_1__)
  if constexpr (F32) {
    int b;
    std::memcpy(&b, p, 4);
    return (vi)_mm_cvtepu8_epi32(_mm_cvtsi32_si128(b));
  }
#endif
  vi v;
  for (int i = 0; i < VL; i++) v[i] = p[i];
  return v;
}
SIMD void narrow(uint8_t *p, vi v) {  // the other way, for numbers below 256
#if defined(__AVX512F__)
  if constexpr (F32) return _mm_storeu_si128((__m128i *)p, _mm512_cvtepi32_epi8((__m512i)v));
#elif defined(__AVX2__)
  if constexpr (F32) {
    const __m128i w = _mm_packus_epi32(_mm256_castsi256_si128((__m256i)v), _mm256_extracti128_si256((__m256i)v, 1));
    return _mm_storel_epi64((__m128i *)p, _mm_packus_epi16(w, w));
  }
#elif defined(__SSE4_1__)
  if constexpr (F32) {
    const __m128i w = _mm_packus_epi32((__m128i)v, (__m128i)v);
    const int b = _mm_cvtsi128_si32(_mm_packus_epi16(w, w));
    return (void)std::memcpy(p, &b, 4);
  }
#endif
  for (int i = 0; i < VL; i++) p[i] = uint8_t(v[i]);
}
SIMD vi iota() {
  vi v;
  for (int i = 0; i < VL; i++) v[i] = i;
  return v;
}
SIMD vf to_real(vi v) { return __builtin_convertvector(v, vf); }
SIMD vf select(vi m, vf a, vf b) { return m ? a : b; }
// As instructions: GCC 12 makes two of a < b ? a : b.
#if defined(__AVX512F__)
SIMD vf min(vf a, vf b) {
  if constexpr (F32) return (vf)_mm512_min_ps((__m512)a, (__m512)b);
  else return (vf)_mm512_min_pd((__m512d)a, (__m512d)b);
}
SIMD vf max(vf a, vf b) {
  if constexpr (F32) return (vf)_mm512_max_ps((__m512)a, (__m512)b);
  else return (vf)_mm512_max_pd((__m512d)a, (__m512d)b);
}
#elif defined(__AVX2__)
SIMD vf min(vf a, vf b) {
  if constexpr (F32) return (vf)_mm256_min_ps((__m256)a, (__m256)b);
  else return (vf)_mm256_min_pd((__m256d)a, (__m256d)b);
}
SIMD vf max(vf a, vf b) {
  if constexpr (F32) return (vf)_mm256_max_ps((__m256)a, (__m256)b);
  else return (vf)_mm256_max_pd((__m256d)a, (__m256d)b);
}
#elif defined(__SSE4_2__)
SIMD vf min(vf a, vf b) {
  if constexpr (F32) return (vf)_mm_min_ps((__m128)a, (__m128)b);
  else return (vf)_mm_min_pd((__m128d)a, (__m128d)b);
}
SIMD vf max(vf a, vf b) {
  if constexpr (F32) return (vf)_mm_max_ps((__m128)a, (__m128)b);
  else return (vf)_mm_max_pd((__m128d)a, (__m128d)b);
}
#else
SIMD vf min(vf a, vf b) { return a < b ? a : b; }
SIMD vf max(vf a, vf b) { return a > b ? a : b; }
#endif
SIMD vf clamp(vf x, vf lo, vf hi) { return min(max(x, lo), hi); }
SIMD vf clamp(vf x, real lo, real hi) { return clamp(x, splat(lo), splat(hi)); }
// Joins the lanes pairwise: fewer steps than one lane after the other, and less error.
template <int N, class Join> SIMD real join_lanes(const real *p, Join join) {
  if constexpr (N == 2) return join(p[0], p[1]);
  else {
    typedef real half __attribute__((vector_size(N / 2 * sizeof(real))));
    half a, b;
    std::memcpy(&a, p, sizeof a), std::memcpy(&b, p + N / 2, sizeof b);
    a = join(a, b);
    return join_lanes<N / 2>((const real *)&a, join);
  }
}
SIMD real sum(vf v) {
  return join_lanes<VL>((const real *)&v, [](auto a, auto b) SIMD_LAMBDA { return a + b; });
}
SIMD real least(vf v) {
  return join_lanes<VL>((const real *)&v, [](auto a, auto b) SIMD_LAMBDA { return a < b ? a : b; });
}
SIMD real most(vf v) {
  return join_lanes<VL>((const real *)&v, [](auto a, auto b) SIMD_LAMBDA { return a > b ? a : b; });
}

// compress_store(dst, v, m): the lanes of v where m is set, contiguously; up to VL elements of dst are overwritten.
#if defined(__AVX512F__)
SIMD vf sqrt(vf x) {
  if constexpr (F32) return (vf)_mm512_maskz_sqrt_ps(0xffff, (__m512)x);
  else return (vf)_mm512_maskz_sqrt_pd(0xff, (__m512d)x);
}
SIMD Mask bits(vi m) {
  if constexpr (F32) return _mm512_movepi32_mask((__m512i)m);
  else return _mm512_movepi64_mask((__m512i)m);
}
template <class T> SIMD void compress_store(T *dst, vi v, Mask m) {  // the memory form of vpcompress is slow on Zen 4
  if constexpr (F32) v = (vi)_mm512_maskz_compress_epi32((__mmask16)m, (__m512i)v);
  else v = (vi)_mm512_maskz_compress_epi64((__mmask8)m, (__m512i)v);
  std::memcpy((void *)dst, &v, sizeof v);
}
#else
#if defined(__AVX2__)
SIMD vf sqrt(vf x) {
  if constexpr (F32) return (vf)_mm256_sqrt_ps((__m256)x);
  else return (vf)_mm256_sqrt_pd((__m256d)x);
}
SIMD Mask bits(vi m) {
  if constexpr (F32) return _mm256_movemask_ps((__m256)m);
  else return _mm256_movemask_pd((__m256d)m);
}
struct CompressTable {
  alignas(32) int32_t index[256][8] = {};
  constexpr CompressTable() {
    for (int m = 0; m < 256; m++)
      for (int i = 0, n = 0; i < 8; i++)
        if (m >> i & 1) index[m][n++] = i;
  }
};
static constexpr CompressTable compress_table;  // constexpr: no AVX2 code may run at load time
#elif defined(__SSE4_2__)
SIMD vf sqrt(vf x) {
  if constexpr (F32) return (vf)_mm_sqrt_ps((__m128)x);
  else return (vf)_mm_sqrt_pd((__m128d)x);
}
SIMD Mask bits(vi m) {
  if constexpr (F32) return _mm_movemask_ps((__m128)m);
  else return _mm_movemask_pd((__m128d)m);
}
#else
SIMD vf sqrt(vf x) {
  for (int i = 0; i < VL; i++) x[i] = std::sqrt(x[i]);
  return x;
}
SIMD Mask bits(vi m) {
  Mask b = 0;
  for (int i = 0; i < VL; i++) b |= Mask(m[i] & 1) << i;
  return b;
}
#endif
template <class T> SIMD void compress_store(T *dst, vi v, Mask m) {
#if defined(__AVX2__)
  if constexpr (F32) {
    const __m256i p = _mm256_permutevar8x32_epi32((__m256i)v, _mm256_load_si256((const __m256i *)compress_table.index[m]));
    std::memcpy((void *)dst, &p, sizeof p);
    return;
  }
#endif
  integer lane[VL];
  std::memcpy(lane, &v, sizeof v);
  for (int n = 0; m; m &= m - 1) std::memcpy((void *)(dst + n++), lane + __builtin_ctz(m), sizeof(T));
}
#endif
template <class T> SIMD void compress_store(T *dst, vf v, Mask m) { compress_store(dst, (vi)v, m); }
SIMD bool any(vi m) { return bits(m) != 0; }
// A row of VL numbers that nobody reads soon, past the caches where that is possible; p is aligned to it if `aligned`.
SIMD void stream(real *p, vf v, bool aligned) {
#if defined(__AVX512F__)
  if constexpr (F32)
    if (aligned) return _mm512_stream_ps(p, (__m512)v);
#elif defined(__AVX2__)
  if constexpr (F32)
    if (aligned) return _mm256_stream_ps(p, (__m256)v);
#elif defined(__SSE4_2__)
  if constexpr (F32)
    if (aligned) return _mm_stream_ps((float *)p, (__m128)v);
#endif
  (void)aligned;
  store(p, v);
}
// Lanes from two vectors, by number: those of b count from VL on.
SIMD vf lanes_of(vf a, vf b, vi from) {
#if defined(__clang__)
  vf v;
  for (int i = 0; i < VL; i++) v[i] = from[i] < VL ? a[from[i] & (VL - 1)] : b[from[i] & (VL - 1)];
  return v;
#else
  return __builtin_shuffle(a, b, from);
#endif
}
// Quarter PART of the lanes, each four times.
template <int PART> SIMD vf repeat4(vf v) { return lanes_of(v, v, (iota() >> 2) + integer(PART * VL / 4)); }
// Every fourth number of four vectors.
SIMD vf fourths(const vf *v) {
  const vi half = (iota() & (VL / 2 - 1)) * 4 + 3;
  const vf first = lanes_of(v[0], v[1], half), last = lanes_of(v[2], v[3], half);
  return lanes_of(first, last, iota() + (iota() / (VL / 2)) * (VL / 2));
}
// The vector of four numbers, repeated.
template <class V4> SIMD vf tile4(V4 q) {
  vf v;
  for (int i = 0; i < VL; i++) v[i] = q[i % 4];
  return v;
}
// The sums of VL vectors, one a lane: halves of two vectors are added into one, then quarters of two such, down to single lanes.
template <int N = VL> SIMD vf sums(const vf *v) {
  if constexpr (N == 1) return v[0];
  else {
    // Lanes come in groups of N, what is left of one sum each. Halves of a group are added: N / 2 lanes of v[i], then as many of v[i + N / 2].
    const vi group = iota() / N * N, place = iota() & (N / 2 - 1), from = group + place + (iota() & (N / 2) ? splat_int(VL) : vi{});
    vf half[N / 2];
    for (int i = 0; i < N / 2; i++) half[i] = lanes_of(v[i], v[i + N / 2], from) + lanes_of(v[i], v[i + N / 2], from + integer(N / 2));
    return sums<N / 2>(half);
  }
}
// Of four vectors of (r, g, b, -), the three vectors of what is left without the fourth numbers: PART comes from the vectors PART and PART + 1.
// In registers: loads across two earlier stores would wait for both.
template <int PART> SIMD vf triples(vf a, vf b) {
  vi from;
  for (int i = 0; i < VL; i++) {
    const int at = PART * VL + i, pixel = at / 3;
    from[i] = pixel * 4 + at % 3 - PART * VL;
  }
  return lanes_of(a, b, from);
}
// The other way: a quarter of the triples in three vectors as (r, g, b, b), of the vectors PART / 2 and the next.
template <int PART> SIMD vf quads(vf a, vf b) {
  vi from;
  for (int i = 0; i < VL; i++) from[i] = PART * VL * 3 / 4 + i / 4 * 3 + (i % 4 < 3 ? i % 4 : 2) - PART / 2 * VL;
  return lanes_of(a, b, from);
}
SIMD int count(Mask m) { return __builtin_popcount(m); }
SIMD Mask first_lanes(int n) { return n >= VL ? Mask((uint64_t(1) << VL) - 1) : Mask((uint64_t(1) << n) - 1); }

// e^x for -80 < x <= 0: Cephes' expf, relative error 2e-7; in double precision the library's.
SIMD vf exp(vf x) {
  if constexpr (!F32) {
    for (int i = 0; i < VL; i++) x[i] = std::exp(x[i]);
    return x;
  } else {
    const vf y = x * real(1.44269504089) - real(.5);
    const vi n = __builtin_convertvector(y, vi);  // towards zero: rounds y + 1/2 to nearest for y <= 0
    const vf f = to_real(n), r = (x - f * real(.693359375)) - f * real(-2.12194440e-4);
    vf p = splat(real(1.9875691500e-4));
    p = p * r + real(1.3981999507e-3), p = p * r + real(8.3334519073e-3), p = p * r + real(4.1665795894e-2);
    p = p * r + real(1.6666665459e-1), p = p * r + real(5.0000001201e-1);
    p = p * r * r + r + real(1);
    return p * (vf)((n + integer(127)) << 23);
  }
}
}  // namespace ISA
}  // namespace stroke
