#pragma once

#include <string>

namespace drivebench {

/// The FileDescriptorSet of bench.proto, serialised: what a generic client or reader needs to decode every
/// message.
std::string bench_descriptor_set();

}  // namespace drivebench
