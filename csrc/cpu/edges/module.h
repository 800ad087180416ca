// What the Python module has of edges that views show.
#pragma once
#include <nanobind/nanobind.h>

namespace stroke::edges {
void bind(nanobind::module_ &m);
}
