#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>

#include "server/engine/engine.hpp"

/// Short ways to ask an engine for something.
namespace drivebench {

inline constexpr Owner kMe = 1;
inline constexpr Owner kStranger = 2;

inline Input lease(LeaseAction action, std::uint32_t axis = 0, Owner owner = kMe) {
  return {.tick = 0, .axis = axis, .owner = owner, .action = action};
}

/// Carries out a request and hands back the answer, which lockstep gives at once.
inline Refused ask(Engine& engine, const Input& input) {
  std::optional<Refused> got;
  engine.request(input, [&got](Refused refused, Tick) { got = refused; });
  EXPECT_TRUE(got) << "no answer";
  return got.value_or(Refused::kBusy);
}

}  // namespace drivebench
