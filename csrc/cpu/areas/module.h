// What the Python module has of areas.
#pragma once
#include <nanobind/nanobind.h>

namespace stroke::areas {
void bind(nanobind::module_ &m);
}
