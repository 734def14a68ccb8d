#pragma once

#include "bench.pb.h"
#include "server/endpoints/tcp/session/dialogue.hpp"

/// What a session tells about the bench.
namespace drivebench {

/// The description in a Welcome, with the parameter values of now.
v1::BenchDescription describe(const Engine& engine);

/// Answers with the parameters that were asked for, or with all of the axis.
void report_parameters(Dialogue& dialogue, const v1::ReadParameters& request);
/// Answers with the state of bench, axes and transports.
void report_status(Dialogue& dialogue);

}  // namespace drivebench
