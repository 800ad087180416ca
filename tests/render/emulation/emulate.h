// CUDA's words for plain C++: every thread of a block is a fiber, blocks run one after the other. Barriers and exchanges between lanes are where
// fibers take turns; a barrier that not all threads reach is an error, as is an exchange that not all lanes of a warp take part in.
#pragma once
#include <csetjmp>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <string>
#include <ucontext.h>
#include <vector>

#define __device__
#define __global__
#define __grid_constant__
#define __launch_bounds__(...)
#define __shared__ static  // one block at a time

namespace emulation {
struct Index {
  unsigned x;
};
inline Index thread, block, block_size, grid_size;

enum class State { ready, at_exchange, at_barrier, done };
struct Fiber {
  State state = State::done;
  jmp_buf place;
  ucontext_t start;
  std::unique_ptr<char[]> stack;
  unsigned parity = 0;
};
// What runs in the fibers of a block, and the fibers, kept between blocks.
class Block {
  static constexpr size_t STACK = size_t(1) << 18;
  std::vector<std::unique_ptr<Fiber>> fibers_;
  ucontext_t ended_;
  jmp_buf scheduler_;
  void (*body_)(void *) = nullptr;
  void *argument_ = nullptr;

  static void enter() {
    for (Block &b = current();;) {
      b.body_(b.argument_);
      b.yield(State::done);
    }
  }
  void run(unsigned i) {
    thread.x = i;
    if (!_setjmp(scheduler_)) _longjmp(fibers_[i]->place, 1);
  }
  void add_fiber() {
    fibers_.push_back(std::make_unique<Fiber>());
    Fiber &f = *fibers_.back();
    f.stack.reset(new char[STACK]);
    getcontext(&f.start);
    f.start.uc_stack.ss_sp = f.stack.get(), f.start.uc_stack.ss_size = STACK, f.start.uc_link = &ended_;
    makecontext(&f.start, enter, 0);
    f.state = State::done;
    // The first turn goes up to the body's door.
    thread.x = unsigned(fibers_.size() - 1);
    body_ = [](void *) {};
    if (!_setjmp(scheduler_)) setcontext(&f.start);
  }
  // Lets the lanes of a warp run until all wait at the barrier or are done. False if some wait for what others passed by.
  bool run_warp(unsigned first, unsigned last, bool backwards) {
    for (;;) {
      unsigned count[4] = {};
      for (unsigned k = first; k < last; k++) {
        const unsigned i = backwards ? first + last - 1 - k : k;
        if (fibers_[i]->state == State::ready) run(i);
      }
      for (unsigned i = first; i < last; i++) count[int(fibers_[i]->state)]++;
      if (!count[int(State::at_exchange)]) return true;
      if (count[int(State::at_exchange)] != last - first) return false;
      for (unsigned i = first; i < last; i++) fibers_[i]->state = State::ready;
    }
  }

public:
  uint64_t slots[2][1024];
  static Block &current() {
    static Block b;
    return b;
  }
  void yield(State state) {
    Fiber &f = *fibers_[thread.x];
    f.state = state;
    if (!_setjmp(f.place)) _longjmp(scheduler_, 1);
  }
  unsigned next_parity() { return fibers_[thread.x]->parity++ & 1; }
  std::string execute(void (*body)(void *), void *argument, unsigned threads, bool backwards) {
    while (fibers_.size() < threads) add_fiber();
    body_ = body, argument_ = argument;
    for (unsigned i = 0; i < threads; i++) fibers_[i]->state = State::ready, fibers_[i]->parity = 0;
    for (;;) {
      unsigned waiting = 0;
      for (unsigned w = 0; w < threads; w += 32) {
        const unsigned first = backwards ? (threads - 1) / 32 * 32 - w : w;
        if (!run_warp(first, first + 32 < threads ? first + 32 : threads, backwards)) return "an exchange without all lanes of its warp";
      }
      for (unsigned i = 0; i < threads; i++) waiting += fibers_[i]->state == State::at_barrier;
      if (!waiting) return "";
      if (waiting != threads) return "a barrier without all threads of its block";
      for (unsigned i = 0; i < threads; i++) fibers_[i]->state = State::ready;
    }
  }
};

// The values of all lanes of this warp, once all have given theirs. Two sets take turns: a lane may be one exchange ahead of another.
template <class T> const uint64_t *exchange(T x) {
  static_assert(sizeof(T) <= 8);
  Block &b = Block::current();
  uint64_t *slots = b.slots[b.next_parity()], bits = 0;
  std::memcpy(&bits, &x, sizeof x);
  slots[thread.x] = bits;
  b.yield(State::at_exchange);
  return slots + thread.x / 32 * 32;
}
template <class T> T value_of(T x, unsigned lane) {
  std::memcpy(&x, exchange(x) + lane, sizeof x);
  return x;
}

// Runs a kernel; backwards: threads and blocks in the opposite order. Returns what went wrong, or an empty string.
template <class Job> const char *run(void (*kernel)(Job), unsigned blocks, unsigned threads, const Job *job, int backwards) {
  static std::string error;
  struct Call {
    void (*kernel)(Job);
    const Job *job;
  } call{kernel, job};
  block_size.x = threads, grid_size.x = blocks;
  for (unsigned k = 0; k < blocks; k++) {
    block.x = backwards ? blocks - 1 - k : k;
    auto body = [](void *p) { static_cast<Call *>(p)->kernel(*static_cast<Call *>(p)->job); };
    error = Block::current().execute(body, &call, threads, backwards);
    if (!error.empty()) break;
  }
  return error.c_str();
}
}  // namespace emulation

// What a library of kernels says of itself, and how it runs one.
#define EMULATE(Job)                                                                                                                                 \
  extern "C" size_t job_size() { return sizeof(Job); }                                                                                               \
  extern "C" const char *emulate(void (*kernel)(Job), unsigned blocks, unsigned threads, const Job *job, int backwards) {                            \
    return emulation::run(kernel, blocks, threads, job, backwards);                                                                                  \
  }

#define threadIdx emulation::thread
#define blockIdx emulation::block
#define blockDim emulation::block_size
#define gridDim emulation::grid_size
inline void __syncthreads() { emulation::Block::current().yield(emulation::State::at_barrier); }
inline void __syncwarp() { emulation::exchange(0); }
template <class T> T __shfl_sync(unsigned, T x, unsigned from) { return emulation::value_of(x, from % 32); }
template <class T> T __shfl_xor_sync(unsigned, T x, unsigned bits) { return emulation::value_of(x, (threadIdx.x % 32) ^ bits); }
template <class T> T __shfl_up_sync(unsigned, T x, unsigned by) {
  const unsigned lane = threadIdx.x % 32;
  return emulation::value_of(x, lane >= by ? lane - by : lane);
}
inline unsigned __ballot_sync(unsigned, bool vote) {
  const uint64_t *votes = emulation::exchange(unsigned(vote));
  unsigned mask = 0;
  for (unsigned k = 0; k < 32; k++) mask |= unsigned(votes[k]) << k;
  return mask;
}
inline int __popc(unsigned x) { return __builtin_popcount(x); }
inline int __ffs(unsigned x) { return __builtin_ffs(int(x)); }
template <class T> T atomicAdd(T *p, T x) {
  const T old = *p;
  *p += x;
  return old;
}
template <class T> T atomicMax(T *p, T x) {
  const T old = *p;
  if (x > old) *p = x;
  return old;
}
