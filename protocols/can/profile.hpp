#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/table.hpp"

namespace drivebench::can {

/// A count of a duty in a classic frame.
inline constexpr double kDutyUnit = 1.0 / 32767.0;

inline constexpr std::size_t kMessageCount = static_cast<std::size_t>(Message::kDetails) + 1;
/// The largest node id; as in CANopen. The 11-bit identifiers of IdSet::kFree have room for fewer nodes.
inline constexpr std::uint32_t kMaxNode = 127;
inline constexpr std::uint32_t kMaxFreeNode = 15;

/// Whether a message exists in a variant of the profile.
constexpr bool is_in(const MessageRow& row, bool fd) noexcept {
  return row.variant == Variant::kBoth || (row.variant == Variant::kFd) == fd;
}

struct IdRange {
  std::uint32_t first;
  std::uint32_t last;
};
/// The identifiers that a message has over all nodes.
constexpr IdRange ids_of(const MessageRow& row, std::uint32_t base_id, std::uint32_t max_node) noexcept {
  return row.per_node ? IdRange{base_id + 1, base_id + max_node} : IdRange{base_id, base_id};
}

using BaseIds = std::array<std::uint32_t, kMessageCount>;
/// The default identifiers, by Message. With 29 bits IdSet::kFree has the same numbers 12 bits higher: room
/// for all nodes, and no identifier below 0x800, which some programs take for one of 11 bits.
constexpr BaseIds default_ids(IdSet set, bool extended) noexcept {
  BaseIds ids{};
  for (const MessageRow& row : kMessages) {
    ids[static_cast<std::size_t>(row.message)] =
        set == IdSet::kCanopen ? row.canopen_id : row.free_id << (extended ? 12U : 0U);
  }
  return ids;
}

/// The names of the sets in configurations and addresses, by IdSet.
inline constexpr std::array<std::string_view, 2> kIdSetNames = {"free", "canopen"};

/// The settings on which both ends of a bus must agree.
struct Profile {
  bool fd = true;         ///< FD frames with float32; otherwise classic frames with scaled integers
  bool extended = false;  ///< 29-bit identifiers
  IdSet id_set = IdSet::kFree;
  bool wide = false;  ///< wide axes are on the bus: their messages have identifiers too
  /// By Message; messages of an axis add the node id.
  BaseIds base_ids = default_ids(IdSet::kFree, false);
  // The values of one count of scaled fields.
  double current_unit_a = 1e-3;
  double voltage_unit_v = 1e-2;
  double bus_voltage_unit_v = 1e-1;
  double speed_unit_rad_s = 1e-1;
  double edge_time_unit_s = 1e-6;

  /// Takes the default identifiers of a set.
  void choose_ids(IdSet set, bool with_29_bits) noexcept {
    id_set = set;
    extended = with_29_bits;
    base_ids = default_ids(set, with_29_bits);
  }
  std::uint32_t max_node() const noexcept {
    return id_set == IdSet::kFree && !extended ? kMaxFreeNode : kMaxNode;
  }
  double unit_of(Unit unit) const noexcept {
    switch (unit) {
      case Unit::kCurrent:
        return current_unit_a;
      case Unit::kVoltage:
        return voltage_unit_v;
      case Unit::kBusVoltage:
        return bus_voltage_unit_v;
      case Unit::kSpeed:
        return speed_unit_rad_s;
      case Unit::kEdgeTime:
        return edge_time_unit_s;
      case Unit::kResolver:
        return 1e-3;
      case Unit::kTemperature:
        return 0.1;
      case Unit::kDuty:
        return kDutyUnit;
      case Unit::kNone:
        break;
    }
    return 1.0;
  }
  std::uint32_t id_of(const MessageRow& row, std::uint32_t node) const noexcept {
    return base_ids[static_cast<std::size_t>(row.message)] + (row.per_node ? node : 0);
  }
};

/// Whether a message exists on the bus.
constexpr bool is_on(const MessageRow& row, const Profile& profile) noexcept {
  return is_in(row, profile.fd) && (row.width != Width::kWide || profile.wide);
}

/// An axis on a bus.
struct BusAxis {
  std::string name;
  std::uint32_t node = 1;
  bool wide = false;
};

/// Whether a message belongs to axes of this width.
inline bool has_message(const BusAxis& axis, const MessageRow& row) noexcept {
  return row.width == Width::kAny || (row.width == Width::kWide) == axis.wide;
}

/// A problem of a profile or of the nodes on its bus: the field ("ids.command", "current_unit_a", "node") and
/// the rule that it breaks.
struct ProfileProblem {
  std::string field;
  std::string rule;
};
std::vector<ProfileProblem> problems(const Profile& profile, std::span<const std::uint32_t> nodes = {});

}  // namespace drivebench::can
