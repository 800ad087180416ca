// What the Python module has of boxes.
#pragma once
#include <nanobind/nanobind.h>

namespace stroke::boxes {
void bind(nanobind::module_ &m);
}
