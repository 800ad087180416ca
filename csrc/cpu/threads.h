// A pool of threads that share loops.
#pragma once
#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>
#if !defined(_WIN32)
#include <pthread.h>
#endif

namespace stroke {
inline void relax() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  __asm__ volatile("yield");
#endif
}

// run(n, g, f): f(i, thread) for i in [0, n), taken in dynamic order, in runs that shrink down to g. Workers spin briefly before they sleep; one
// that comes late (or not at all: on a busy machine, or in a forked child, which has no workers) is not waited for. The first exception is
// rethrown. parts: of how many parts the items in front of each, and all n, consist; runs then are of like work.
class Threads {
  using Body = std::function<void(int, int)>;
  static constexpr int RUNS = 4, PART = 4;  // runs of what is left, a thread; work of a part in that of an item without any (empirical)
  std::vector<std::thread> workers_;
  std::mutex mutex_, busy_, error_mutex_;
  std::condition_variable wake_;
  std::atomic<uint32_t> epoch_{0};
  std::atomic<int> next_{0}, active_{0};
  std::exception_ptr error_;
  const Body *body_ = nullptr;
  const uint32_t *parts_ = nullptr;
  int count_ = 0, grain_ = 1;
  bool open_ = false, stop_ = false;

  int64_t work_before(int i) const { return i + (parts_ ? PART * int64_t(parts_[i]) : 0); }
  // The next run: a fraction of the work that is left, since every exchange between threads waits for this one's stores past the caches.
  bool take(int &begin, int &end) {
    for (begin = next_; begin < count_;) {
      const int64_t start = work_before(begin), goal = start + (work_before(count_) - start) / (RUNS * size());
      end = begin + std::min(grain_, count_ - begin);
      for (int beyond = count_ + 1; beyond - end > 1;) {
        const int middle = end + (beyond - end) / 2;
        (work_before(middle) <= goal ? end : beyond) = middle;
      }
      if (next_.compare_exchange_weak(begin, end)) return true;
    }
    return false;
  }
  void work(int id) noexcept {
    try {
      for (int begin, end; take(begin, end);)
        for (int i = begin; i < end; i++) (*body_)(i, id);
#if defined(__x86_64__)
      __builtin_ia32_sfence();  // stores past the caches are not ordered otherwise
#endif
    } catch (...) {
      std::lock_guard guard(error_mutex_);
      if (!error_) error_ = std::current_exception();
      next_ = count_;
    }
  }
  void loop(int id) {
    for (uint32_t seen = 0;;) {
      for (int spin = 0; spin < 4000 && epoch_ == seen; spin++) relax();
      {
        std::unique_lock lock(mutex_);
        wake_.wait(lock, [&] { return stop_ || epoch_ != seen; });
        if (stop_) return;
        seen = epoch_;
        if (!open_) continue;
        active_++;
      }
      work(id);
      active_--;
    }
  }
  void join_all() {
    {
      std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    for (auto &t : workers_) t.join();
    workers_.clear(), stop_ = false, epoch_ = 0;
  }

public:
  int size() const { return int(workers_.size()) + 1; }
  // Held for a whole call: two calls at a time would share scratch memory.
  std::mutex &busy() { return busy_; }
  void resize(int n) {
    if (n == size()) return;
    join_all();
    for (int i = 1; i < n; i++) workers_.emplace_back([this, i] { loop(i); });
  }
  void run(int n, int grain, const Body &body, const uint32_t *parts = nullptr) {
    if (n <= 0) return;
    const bool alone = workers_.empty() || n <= grain;
    {
      std::lock_guard lock(mutex_);
      body_ = &body, parts_ = parts, count_ = n, grain_ = grain, next_ = 0, error_ = nullptr, open_ = !alone;
      if (open_) epoch_++;
    }
    if (!alone) wake_.notify_all();
    work(0);
    {
      std::lock_guard lock(mutex_);
      open_ = false;
    }
    for (int spin = 0; active_; spin++) spin < 2000 ? relax() : std::this_thread::yield();
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }
  // A forked child has the parent's memory but none of its threads.
  void forget_workers() {
    for (auto &t : workers_) t.detach();
    workers_.clear();
    new (&mutex_) std::mutex, new (&busy_) std::mutex, new (&error_mutex_) std::mutex, new (&wake_) std::condition_variable;
    epoch_ = 0, active_ = 0, stop_ = false, open_ = false;
  }
};

// Never destroyed: workers may still wait when the process ends.
inline Threads &threads() {
  static Threads *t = [] {
    auto *fresh = new Threads;
#if !defined(_WIN32)
    static Threads *kept;
    kept = fresh;
    pthread_atfork(nullptr, nullptr, [] { kept->forget_workers(); });
#endif
    return fresh;
  }();
  return *t;
}
}  // namespace stroke
