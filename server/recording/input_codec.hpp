#pragma once

#include <optional>
#include <span>
#include <vector>

#include "bench.pb.h"
#include "plant/parameters/parameters.hpp"
#include "server/bench/bench.hpp"
#include "server/bench/input.hpp"
#include "server/pacing/verdict.hpp"

namespace drivebench {

/// The parameters of each axis, which recordings know by name.
using ParameterTables = std::vector<std::span<const Parameter>>;
ParameterTables parameter_tables(const BenchSetup& setup);

/// An input that came in before tick `received` ran, as it stands in a recording. Its axis exists.
void encode_input(Tick received, const Input& input, const ParameterTables& tables, v1::Input& message);

/// The input of a recorded message; nothing if it asks for something that does not exist.
std::optional<Input> decode_input(const v1::Input& message, const ParameterTables& tables);

/// A command of the wire; nothing if its gates are unknown.
std::optional<Command> decode_command(const v1::Command& message);

void encode_verdict(const Verdict& verdict, v1::Verdict& message);

v1::Mode wire_mode(RunMode mode) noexcept;

}  // namespace drivebench
