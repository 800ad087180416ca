// Tensors of torch as the kernels read them, and arrays that they give back.
#pragma once
#include "cpu/memory.h"
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <initializer_list>
#include <stdexcept>
#include <type_traits>
namespace nb = nanobind;

namespace stroke {
// Names of torch's, made once: asking for them is most of what it takes to read a tensor.
struct Torch {
  nb::object dtype = name("dtype"), shape = name("shape"), data_ptr = name("data_ptr"), is_contiguous = name("is_contiguous"),
             is_neg = name("is_neg");
  nb::object is_cpu = name("is_cpu"), float32, float64, int32, int64, uint8, boolean;
  static nb::object name(const char *text) { return nb::steal(PyUnicode_InternFromString(text)); }
  Torch() {
    const nb::module_ torch = nb::module_::import_("torch");
    float32 = torch.attr("float32"), float64 = torch.attr("float64"), int32 = torch.attr("int32"), int64 = torch.attr("int64"),
    uint8 = torch.attr("uint8"), boolean = torch.attr("bool");
  }
  template <class S> const nb::object &dtype_of() const {
    if constexpr (std::is_same_v<S, bool>) return boolean;
    else if constexpr (std::is_same_v<S, uint8_t>) return uint8;
    else if constexpr (std::is_same_v<S, int64_t>) return int64;
    else if constexpr (std::is_same_v<S, int32_t>) return int32;
    else return sizeof(S) == 4 ? float32 : float64;
  }
};
inline const Torch &torch() {
  static const Torch *t = new Torch;
  return *t;
}

inline void require(bool good, const char *what) {
  if (!good) throw std::invalid_argument(what);
}

// A tensor on the CPU, held, with its numbers in one run of memory; or None. Read by itself: the way through a numpy array takes four times as
// long, which tiny images feel.
template <class S> class In {
  nb::object held_;
  const S *data_ = nullptr;
  size_t ndim_ = 0, shape_[4] = {};

public:
  In() = default;
  explicit In(nb::handle tensor) : held_(nb::borrow(tensor)) {
    if (held_.is_none()) return;
    require(held_.attr(torch().dtype).is(torch().dtype_of<S>()), "a tensor of another dtype");
    require(nb::cast<bool>(held_.attr(torch().is_cpu)), "a tensor on another device");
    if (nb::cast<bool>(held_.attr(torch().is_neg)())) held_ = held_.attr("resolve_neg")();
    if (!nb::cast<bool>(held_.attr(torch().is_contiguous)())) held_ = held_.attr("contiguous")();
    const nb::object shape = held_.attr(torch().shape);
    ndim_ = nb::len(shape);
    require(ndim_ <= 4, "a tensor with more than four axes");
    for (size_t k = 0; k < ndim_; k++) shape_[k] = nb::cast<size_t>(shape[k]);
    data_ = reinterpret_cast<const S *>(nb::cast<uintptr_t>(held_.attr(torch().data_ptr)()));
    require(data_ || size() == 0, "a tensor without memory");
  }
  bool given() const { return held_.is_valid() && !held_.is_none(); }
  const S *data() const { return data_; }
  size_t ndim() const { return ndim_; }
  size_t shape(size_t k) const { return shape_[k]; }
  size_t size() const {
    size_t n = 1;
    for (size_t k = 0; k < ndim_; k++) n *= shape_[k];
    return n;
  }
};
template <class S> using Out = nb::ndarray<nb::numpy, S>;

template <class S> Out<S> array(Buffer<S> &&b, std::initializer_list<size_t> shape) {
  S *p = b.release();
  return Out<S>(p, shape, nb::capsule(p, [](void *q) noexcept { pool().give(q); }));
}
template <class T> bool has_shape(const T &a, std::initializer_list<size_t> shape) {
  if (a.ndim() != shape.size()) return false;
  size_t k = 0;
  for (size_t n : shape)
    if (a.shape(k++) != n) return false;
  return true;
}
inline bool is_float32(nb::handle tensor) { return tensor.attr(torch().dtype).is(torch().float32); }
}  // namespace stroke
