#pragma once

#include <span>
#include <string>
#include <string_view>

#include "clients/control/field_oriented_controller.hpp"
#include "clients/control/servo_move.hpp"

namespace drivebench::control {

/// A controller and a move that belong together, with where their numbers come from.
struct ServoPreset {
  std::string_view name;
  std::string_view source;
  std::string_view expectation;  ///< what a run of it must show
  ControllerParameters controller;
  MoveParameters move;
};

std::span<const ServoPreset> servo_presets() noexcept;

/// nullptr when there is none of that name.
const ServoPreset* find_servo_preset(std::string_view name) noexcept;

/// The preset name with the fewest letters to change, for "did you mean".
std::string_view nearest_servo_preset_name(std::string_view name);

/// All presets for people to read, one paragraph each.
std::string servo_presets_table();

}  // namespace drivebench::control
