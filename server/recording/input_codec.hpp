#pragma once

#include <optional>
#include <span>
#include <vector>

#include "bench.pb.h"
#include "plant/parameters/parameters.hpp"
#include "protocols/leg_edges.hpp"
#include "server/bench/bench.hpp"
#include "server/bench/input.hpp"
#include "server/pacing/verdict.hpp"

namespace drivebench {

/// The parameters of each axis; recordings name parameters, inputs number them.
using ParameterTables = std::vector<std::span<const Parameter>>;
ParameterTables parameter_tables(const BenchSetup& setup);

/// Encodes an input that arrived before tick `received` ran. Its axis must exist.
void encode_input(Tick received, const Input& input, const ParameterTables& tables, v1::Input& message);

/// Decodes a recorded input; nothing if its axis, parameter or fault does not exist.
std::optional<Input> decode_input(const v1::Input& message, const ParameterTables& tables);

/// The edges of a command; more than a list holds are a problem, and so are others in a list that is told to
/// problem_with().
EdgeProblem read_edges(const v1::Command& message, EdgeRecords& edges);

/// The set-points of a command that its gates need.
PhaseValues setpoint_of(const v1::Command& message);

void encode_verdict(const Verdict& verdict, v1::Verdict& message);

v1::Mode wire_mode(RunMode mode) noexcept;

}  // namespace drivebench
