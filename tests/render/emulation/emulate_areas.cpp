// The CUDA kernels of filled and stroked layers as a library for the CPU, as emulate.cpp.
#include "emulate.h"
#include "cuda/areas.cu"

EMULATE(stroke::areas::Job)
