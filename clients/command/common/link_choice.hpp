#pragma once

#include <string>

#include "clients/link/common/address.hpp"

namespace drivebench::command {

/// Where the bench is, and what it asks for.
struct LinkChoice {
  std::string address{link::kDefaultAddress};
  std::string token{};
};

}  // namespace drivebench::command
