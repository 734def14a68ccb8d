#pragma once

#include <bench.pb.h>

#include <memory>

#include "protocols/abi/description.hpp"

namespace drivebench::sdk {

/// The description that a bench sent, for C; `known` are the signals that the link carries.
std::unique_ptr<abi::Description> describe(const v1::BenchDescription& bench, SignalMask known);

}  // namespace drivebench::sdk
