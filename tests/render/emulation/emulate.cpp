// The CUDA kernels as a library for the CPU: -DREAL=float or double, -DSTROKE_EMULATE, include path csrc.
#include "emulate.h"
#include "cuda/pieces.cu"
#include "cuda/chords.cu"
#include "cuda/draw.cu"
#include "cuda/differentiate.cu"
#include "cuda/samples.cu"
#include "cuda/outlines.cu"

using stroke::Job;
using Kernel = void (*)(Job);
struct Call {
  Kernel kernel;
  const Job *job;
};

extern "C" size_t job_size() { return sizeof(Job); }

// Runs a kernel; backwards: threads and blocks in the opposite order. Returns what went wrong, or an empty string.
extern "C" const char *emulate(Kernel kernel, unsigned blocks, unsigned threads, const Job *job, int backwards) {
  static std::string error;
  Call call{kernel, job};
  emulation::block_size.x = threads, emulation::grid_size.x = blocks;
  for (unsigned k = 0; k < blocks; k++) {
    emulation::block.x = backwards ? blocks - 1 - k : k;
    auto body = [](void *p) { static_cast<Call *>(p)->kernel(*static_cast<Call *>(p)->job); };
    error = emulation::Block::current().execute(body, &call, threads, backwards);
    if (!error.empty()) break;
  }
  return error.c_str();
}
