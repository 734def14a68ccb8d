#pragma once

#include "clients/regression/suite/case.hpp"
#include "clients/regression/tables/key_table.hpp"

namespace drivebench::regression {

inline constexpr double kLongestCase_s = 1e6;

/// Reads a table [[step]]. The bench judges the values of its action.
Step read_step(KeyTable& table);

}  // namespace drivebench::regression
