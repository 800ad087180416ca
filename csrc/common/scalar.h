// Scalar arithmetic by one set of names for the CPU, its SIMD vectors (cpu/simd.h) and CUDA.
//
// Functions in common/ are templated on two types: S, the scalar in which strokes are stored, and F, the type in which pixels are processed. The
// CPU's kernels pass a SIMD vector for F, CUDA's a scalar. Branches are written select(mask, a, b), overloaded for both.
#pragma once
#ifdef __CUDACC__  // nvcc and NVRTC
#define HD __host__ __device__ __forceinline__
#else
#define HD inline __attribute__((always_inline))
#endif

namespace stroke {

HD bool any(bool m) { return m; }
HD float select(bool m, float a, float b) { return m ? a : b; }
HD double select(bool m, double a, double b) { return m ? a : b; }
// What is no number becomes lo, as it does in vectors.
HD float clamp(float x, float lo, float hi) { return x > lo ? x < hi ? x : hi : lo; }
HD double clamp(double x, double lo, double hi) { return x > lo ? x < hi ? x : hi : lo; }
#ifdef __CUDACC__
HD float sqrt(float x) { return ::sqrtf(x); }
HD double sqrt(double x) { return ::sqrt(x); }
HD float exp(float x) { return ::expf(x); }
HD double exp(double x) { return ::exp(x); }
HD double cbrt(double x) { return ::cbrt(x); }
HD double round(double x) { return ::round(x); }
HD double ceil(double x) { return ::ceil(x); }
HD double floor(double x) { return ::floor(x); }
HD double cos(double x) { return ::cos(x); }
HD double sin(double x) { return ::sin(x); }
HD float atan2(float y, float x) { return ::atan2f(y, x); }
HD double atan2(double y, double x) { return ::atan2(y, x); }
#else
HD float sqrt(float x) { return __builtin_sqrtf(x); }
HD double sqrt(double x) { return __builtin_sqrt(x); }
HD float exp(float x) { return __builtin_expf(x); }
HD double exp(double x) { return __builtin_exp(x); }
HD double cbrt(double x) { return __builtin_cbrt(x); }
HD double round(double x) { return __builtin_round(x); }
HD double ceil(double x) { return __builtin_ceil(x); }
HD double floor(double x) { return __builtin_floor(x); }
HD double cos(double x) { return __builtin_cos(x); }
HD double sin(double x) { return __builtin_sin(x); }
HD float atan2(float y, float x) { return __builtin_atan2f(y, x); }
HD double atan2(double y, double x) { return __builtin_atan2(y, x); }
#endif
HD float min(float a, float b) { return a < b ? a : b; }
HD double min(double a, double b) { return a < b ? a : b; }
HD float max(float a, float b) { return a > b ? a : b; }
HD double max(double a, double b) { return a > b ? a : b; }

// As std::min and std::max, which device code has not.
template <class T> HD T least(T a, T b) { return b < a ? b : a; }
template <class T> HD T most(T a, T b) { return a < b ? b : a; }
template <class T> HD T least(T a, T b, T c, T d) { return least(least(a, b), least(c, d)); }
template <class T> HD T most(T a, T b, T c, T d) { return most(most(a, b), most(c, d)); }
template <class T> HD T abs(T x) { return x < 0 ? -x : x; }
template <class T> HD T length(T x, T y) { return sqrt(x * x + y * y); }
}  // namespace stroke
