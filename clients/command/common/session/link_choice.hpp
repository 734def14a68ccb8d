#pragma once

#include <string>

#include "clients/link/common/address.hpp"

namespace drivebench::command {

/// The address of the bench and the token for it.
struct LinkChoice {
  std::string address{link::kDefaultAddress};
  std::string token{};
  bool conducts = false;  ///< changes axes that other sessions hold
};

}  // namespace drivebench::command
