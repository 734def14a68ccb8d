#pragma once

#include <string_view>

#include "clients/regression/suite/case.hpp"

namespace drivebench::regression {

/// The line of the case file that asks for what stands in a line of its composed bench: that of a step or of
/// an override, or of the combination of the matrix that replaced it. 0: it is from the bench file.
int line_in_case(const Case& c, std::string_view composed, int composed_line);

}  // namespace drivebench::regression
