#pragma once

#include "server/experiments/plan.hpp"

namespace drivebench {

/// Checks the input of a request and adds it to the plan, whose axis, ticks and configuration are set.
void add_input(const v1::ExperimentInput& input, const TableLookup& tables, ExperimentPlan& plan);

}  // namespace drivebench
