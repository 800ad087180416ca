// The CUDA kernels as a library for the CPU: -DREAL=float or double, -DSTROKE_EMULATE, include path csrc.
#include "emulate.h"
#include "cuda/pieces.cu"
#include "cuda/chords.cu"
#include "cuda/draw.cu"
#include "cuda/differentiate.cu"
#include "cuda/samples.cu"
#include "cuda/outlines.cu"

EMULATE(stroke::Job)
