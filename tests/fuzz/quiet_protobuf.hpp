#pragma once

#include <google/protobuf/stubs/logging.h>

namespace drivebench::fuzz {

/// Protobuf would print a line for each text that is not UTF-8.
inline void silence_protobuf() {
  [[maybe_unused]] static const auto kPrinter = google::protobuf::SetLogHandler(nullptr);
}

}  // namespace drivebench::fuzz
