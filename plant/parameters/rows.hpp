#pragma once

#include <span>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "plant/parameters/parameters.hpp"

/// The form of the tables of the sections: one row for each member, found by its path from AxisParameters.
namespace drivebench {

enum Trait : unsigned { kReal = 0, kInteger = 1, kLive = 2, kRequired = 4, kLater = 8 };

namespace rows_detail {

template <auto First, auto... Rest, class Struct>
constexpr auto& at_path(Struct& s) noexcept {
  if constexpr (sizeof...(Rest) == 0) {
    return s.*First;
  } else {
    return at_path<Rest...>(s.*First);
  }
}

template <class Member>
constexpr void assign(Member& member, double value) noexcept {
  if constexpr (std::is_floating_point_v<Member>) {
    member = value;
  } else {
    member = static_cast<Member>(static_cast<long long>(value));
  }
}

constexpr Parameter described(std::string_view name, std::string_view unit, double minimum, double maximum,
                              unsigned traits, std::string_view meaning, Range usual) {
  return {name,
          unit,
          minimum,
          maximum,
          (traits & kInteger) != 0,
          (traits & kLive) != 0,
          (traits & kRequired) != 0,
          (traits & kLater) != 0,
          meaning,
          nullptr,
          nullptr,
          {},
          usual};
}

}  // namespace rows_detail

/// A member of a section: row<&AxisParameters::mechanics, &MechanicsParameters::inertia_kgm2>(...). Integers,
/// switches and choices are seen as doubles.
template <auto... Path>
struct Row {
  constexpr Parameter operator()(std::string_view name, std::string_view unit, double minimum, double maximum,
                                 unsigned traits, std::string_view meaning, Range usual = {}) const {
    Parameter result = rows_detail::described(name, unit, minimum, maximum, traits, meaning, usual);
    result.get = [](const AxisParameters& p) noexcept {
      return static_cast<double>(rows_detail::at_path<Path...>(p));
    };
    result.set = [](AxisParameters& p, double value) noexcept {
      rows_detail::assign(rows_detail::at_path<Path...>(p), value);
    };
    return result;
  }
};
template <auto... Path>
inline constexpr Row<Path...> row{};

/// A member of a kind of machine: machine_row<PmMachineParameters, &PmMachineParameters::pole_pairs>(...).
template <class Kind, auto Member>
constexpr Parameter machine_row(std::string_view name, std::string_view unit, double minimum, double maximum,
                                unsigned traits, std::string_view meaning, Range usual = {}) {
  Parameter result = rows_detail::described(name, unit, minimum, maximum, traits, meaning, usual);
  result.get = [](const AxisParameters& p) noexcept {
    return static_cast<double>(std::get_if<Kind>(&p.machine)->*Member);
  };
  result.set = [](AxisParameters& p, double value) noexcept {
    rows_detail::assign(std::get_if<Kind>(&p.machine)->*Member, value);
  };
  return result;
}

/// A row whose values have words: choice(row<...>(...), kWords).
constexpr Parameter choice(Parameter result, std::span<const std::string_view> words) {
  result.words = words;
  result.integer = true;
  result.minimum = 0.0;
  result.maximum = static_cast<double>(words.size() - 1);
  return result;
}

/// Shortest text that reads back as the value.
std::string text(double value);

}  // namespace drivebench
