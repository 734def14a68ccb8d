#pragma once

#include <string>

namespace drivebench {

/// The serialised FileDescriptorSet of bench.proto, with which a generic client or reader decodes every
/// message.
std::string bench_descriptor_set();

}  // namespace drivebench
