// What the Python module has of forms.
#pragma once
#include <nanobind/nanobind.h>

namespace stroke::forms {
void bind(nanobind::module_ &m);
}
