#pragma once

#include <optional>

#include "bench.pb.h"
#include "server/input.hpp"
#include "server/verdict.hpp"

namespace drivebench {

/// An input that came in before tick `received` ran, as it stands in a recording.
void encode_input(Tick received, const Input& input, v1::Input& message);

/// The input of a recorded message; nothing if it asks for something that does not exist.
std::optional<Input> decode_input(const v1::Input& message);

/// A command of the wire; nothing if its gates are unknown.
std::optional<Command> decode_command(const v1::Command& message);

void encode_verdict(const Verdict& verdict, v1::Verdict& message);

v1::Mode wire_mode(RunMode mode) noexcept;

}  // namespace drivebench
