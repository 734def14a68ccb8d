#pragma once

#include "bench.pb.h"
#include "server/endpoints/tcp/session/dialogue.hpp"

/// The reports of a session about the bench.
namespace drivebench {

/// The description in a Welcome, with the present parameter values.
v1::BenchDescription describe(const Engine& engine);

/// Answers with the requested parameters, or with all parameters of the axis.
void report_parameters(Dialogue& dialogue, const v1::ReadParameters& request);
/// Answers with the state of bench, axes and transports.
void report_status(Dialogue& dialogue);

}  // namespace drivebench
