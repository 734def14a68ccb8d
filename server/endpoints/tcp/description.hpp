#pragma once

#include <string>

#include "bench.pb.h"
#include "server/engine/engine.hpp"

namespace drivebench {

/// What Welcome says about the bench, with the parameter values of now.
v1::BenchDescription describe(const Engine& engine);

/// One parameter of an axis with its value of now.
v1::ParameterDescription describe_parameter(const Engine& engine, std::size_t axis, std::size_t row);

}  // namespace drivebench
