#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <string>

#include "protocols/signals/sample.hpp"

/// The states and faults of an axis in words.
namespace drivebench::reference {

const char* name_of_state(std::uint64_t state) noexcept;

/// The names of the bits that are set, separated by blanks; "none".
std::string fault_names(const v1::BenchDescription& bench, std::uint64_t faults);
/// The names of the set bits of Sample.injected.
std::string injected_names(const v1::BenchDescription& bench, std::uint64_t injected);
std::uint64_t latched_faults(const v1::BenchDescription& bench, std::uint64_t faults);
/// The latched faults for display; empty: none. For a link without fault descriptions the control state.
std::string latched_text(const v1::BenchDescription& bench, const Sample& sample);

}  // namespace drivebench::reference
