// Recycled memory, so that warm calls take no page faults: blocks, growing arrays of a thread, and arenas that live as long as a state.
#pragma once
#include "cpu/kernel.h"
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <new>
#include <utility>
#include <vector>
#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace stroke {

// Idle blocks by size. Sizes are sixteenths of powers of two; large blocks ask for huge pages. A header in front of each block holds its class.
class Pool {
  static constexpr size_t HEADER = 64, HUGE_PAGE = size_t(1) << 21;
  static constexpr size_t MAX_IDLE = size_t(1) << 30;  // bytes kept; more goes back to the system
  std::mutex mutex_;
  std::vector<void *> idle_[64 * 16];
  size_t idle_bytes_ = 0;

  // Class c holds (16 + c % 16) << (c / 16) bytes.
  static size_t class_size(int c) { return size_t(16 + c % 16) << (c / 16); }
  static int class_of(size_t bytes) {
    int shift = 8;  // at least 4 kB
    while (size_t(31) << shift < bytes) shift++;
    const size_t rest = (bytes + (size_t(1) << shift) - 1) >> shift;
    return 16 * shift + int(rest < 16 ? 0 : rest - 16);
  }
  static void *allocate(int c) {
    const size_t bytes = class_size(c) + HEADER, align = bytes >= HUGE_PAGE ? HUGE_PAGE : HEADER;
    char *base = static_cast<char *>(std::aligned_alloc(align, (bytes + align - 1) / align * align));
    if (!base) throw std::bad_alloc();
#if defined(__linux__)
    if (bytes >= HUGE_PAGE) madvise(base, bytes, MADV_HUGEPAGE);
#endif
    std::memcpy(base, &c, sizeof c);
    return base + HEADER;
  }

public:
  void *take(size_t bytes) {
    if (bytes > size_t(1) << 46) throw std::bad_alloc();
    const int c = class_of(bytes);
    std::lock_guard guard(mutex_);
    if (idle_[c].empty()) return allocate(c);
    void *p = idle_[c].back();  // given back last: it may still be in the caches
    idle_[c].pop_back(), idle_bytes_ -= class_size(c);
    return p;
  }
  void give(void *p) noexcept {
    int c;
    std::memcpy(&c, static_cast<char *>(p) - HEADER, sizeof c);
    std::lock_guard guard(mutex_);
    if (idle_bytes_ + class_size(c) <= MAX_IDLE) {
      try {
        idle_[c].push_back(p), idle_bytes_ += class_size(c);
        return;
      } catch (...) {}
    }
    std::free(static_cast<char *>(p) - HEADER);
  }
  void trim() {
    std::lock_guard guard(mutex_);
    for (auto &blocks : idle_) {
      for (void *p : blocks) std::free(static_cast<char *>(p) - HEADER);
      blocks.clear();
    }
    idle_bytes_ = 0;
  }
};
// Never destroyed: arrays may outlive the module.
inline Pool &pool() {
  static Pool *p = new Pool;
  return *p;
}

// Uninitialised memory from the pool.
template <class T> class Buffer {
  T *p_ = nullptr;
  size_t n_ = 0;

public:
  Buffer() = default;
  explicit Buffer(size_t n) : p_(static_cast<T *>(pool().take(n * sizeof(T) + 64))), n_(n) {}
  Buffer(Buffer &&o) noexcept : p_(std::exchange(o.p_, nullptr)), n_(std::exchange(o.n_, 0)) {}
  Buffer &operator=(Buffer &&o) noexcept {
    std::swap(p_, o.p_), std::swap(n_, o.n_);
    return *this;
  }
  ~Buffer() {
    if (p_) pool().give(p_);
  }
  T *get() const { return p_; }
  T &operator[](size_t i) const { return p_[i]; }
  size_t size() const { return n_; }
  T *release() { return std::exchange(p_, nullptr); }
};

// An array that grows at its end, of plain data.
template <class T> class List {
  Buffer<T> data_;
  size_t n_ = 0;

public:
  T &add(const T &x) {
    if (n_ == data_.size()) {
      Buffer<T> more(n_ < 64 ? 64 : 2 * n_);
      if (n_) std::memcpy(static_cast<void *>(more.get()), data_.get(), n_ * sizeof(T));
      data_ = std::move(more);
    }
    return data_[n_++] = x;
  }
  // Room for n more.
  T *extend(size_t n) {
    if (n_ + n > data_.size()) {
      Buffer<T> more(n_ + n > 2 * n_ ? n_ + n : 2 * n_);
      if (n_) std::memcpy(static_cast<void *>(more.get()), data_.get(), n_ * sizeof(T));
      data_ = std::move(more);
    }
    return data_.get() + std::exchange(n_, n_ + n);
  }
  size_t size() const { return n_; }
  void shorten(size_t n) { n_ = n; }  // keeps its memory
  T &operator[](size_t i) const { return data_[i]; }
  T *begin() const { return data_.get(); }
  T *end() const { return data_.get() + n_; }
};

struct Arena {
  static constexpr size_t CHUNK = size_t(1) << 20;
  std::vector<Buffer<char>> chunks;
  size_t used = 0;
};
struct Scratch {
  Buffer<char> blocks[SCRATCH_BLOCKS], work;
};
}  // namespace stroke
