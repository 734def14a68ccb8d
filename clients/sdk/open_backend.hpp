#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string_view>

#include "clients/link/tcp/tcp_link.hpp"
#include "protocols/abi/backend.hpp"
#include "protocols/abi/bridge.hpp"

namespace drivebench::sdk {

/// The bench cannot be opened: a drivebench_code and the sentence.
class OpenError : public std::runtime_error {
 public:
  OpenError(int code, const std::string& sentence) : std::runtime_error(sentence), code_(code) {}
  int code() const noexcept { return code_; }

 private:
  int code_;
};

/// Opens the way that the address names. `options` are for links. Throws OpenError.
std::unique_ptr<abi::Backend> open_backend(std::string_view address, const link::LinkOptions& options);

/// Opens an axis of "inproc:BENCH" or of the bench behind "shm:PATH" at gate level. Throws OpenError.
std::unique_ptr<abi::Bridge> open_bridge(std::string_view address, std::uint32_t axis);

}  // namespace drivebench::sdk
