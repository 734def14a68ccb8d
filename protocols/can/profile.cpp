#include "protocols/can/profile.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "protocols/can/frame.hpp"

namespace drivebench::can {
namespace {

constexpr bool ids_are_disjoint(IdSet set, bool fd, bool extended) {
  const BaseIds base_ids = default_ids(set, extended);
  const std::uint32_t nodes = set == IdSet::kFree && !extended ? kMaxFreeNode : kMaxNode;
  const auto ids = [&](const MessageRow& row) {
    return ids_of(row, base_ids[static_cast<std::size_t>(row.message)], nodes);
  };
  for (const MessageRow& row : kMessages) {
    if (!is_in(row, fd)) continue;
    if (ids(row).last > (extended ? kMaxExtendedId : kMaxStandardId)) return false;
    for (const MessageRow& other : kMessages) {
      if (!is_in(other, fd) || other.message == row.message) continue;
      if (ids(row).first <= ids(other).last && ids(other).first <= ids(row).last) return false;
    }
  }
  return true;
}

/// Whether CiA 301 gives none of the free identifiers to a service or a default process data object.
constexpr bool is_clear_of_canopen(const MessageRow& row) {
  const IdRange ids = ids_of(row, row.free_id, kMaxFreeNode);
  const auto apart = [&](std::uint32_t first, std::uint32_t last) {
    return ids.last < first || last < ids.first;
  };
  return apart(0x000, 0x001) && apart(0x080, 0x67F) && apart(0x6E0, 0x77F) && apart(0x7DF, 0x7FF);
}

static_assert(ids_are_disjoint(IdSet::kFree, false, false) && ids_are_disjoint(IdSet::kFree, true, false));
static_assert(ids_are_disjoint(IdSet::kFree, false, true) && ids_are_disjoint(IdSet::kFree, true, true));
static_assert(ids_are_disjoint(IdSet::kCanopen, false, false) &&
              ids_are_disjoint(IdSet::kCanopen, true, false));
static_assert(std::ranges::all_of(kMessages, is_clear_of_canopen));
static_assert(std::ranges::is_sorted(kMessages, {}, &MessageRow::free_id));

void add_id_problems(const Profile& profile, std::vector<ProfileProblem>& found) {
  const std::uint32_t limit = profile.extended ? kMaxExtendedId : kMaxStandardId;
  std::vector<const MessageRow*> seen;
  std::optional<Message> before;
  for (const MessageRow& row : kMessages) {
    // A message of narrow and wide axes has two rows.
    if (!is_on(row, profile) || std::exchange(before, row.message) == row.message) continue;
    const std::string field = "ids." + std::string(row.name);
    const std::uint32_t base_id = profile.base_ids[static_cast<std::size_t>(row.message)];
    const std::uint32_t largest = limit - (row.per_node ? profile.max_node() : 0);
    if (base_id > largest) {
      found.push_back({field, "must be at most " + std::to_string(largest) +
                                  (row.per_node ? ", as node ids up to " +
                                                      std::to_string(profile.max_node()) + " are added to it"
                                                : "")});
      continue;
    }
    const IdRange ids = ids_of(row, base_id, profile.max_node());
    for (const MessageRow* other : seen) {
      const IdRange others =
          ids_of(*other, profile.base_ids[static_cast<std::size_t>(other->message)], profile.max_node());
      if (ids.first > others.last || others.first > ids.last) continue;
      found.push_back(
          {field, "must keep its identifiers apart from those of ids." + std::string(other->name)});
    }
    seen.push_back(&row);
  }
}

void add_node_problems(const Profile& profile, std::span<const std::uint32_t> nodes,
                       std::vector<ProfileProblem>& found) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const auto before = nodes.first(i);
    if (nodes[i] < 1 || nodes[i] > profile.max_node())
      found.push_back(
          {"node", "must be 1 to " + std::to_string(profile.max_node()) + ", not " +
                       std::to_string(nodes[i]) +
                       (nodes[i] > kMaxNode || profile.max_node() == kMaxNode
                            ? ""
                            : "; identifiers of 29 bits and those of CANopen have room for 127")});
    else if (std::ranges::find(before, nodes[i]) != before.end())
      found.push_back({"node", "must differ between axes: " + std::to_string(nodes[i]) + " is taken"});
  }
}

}  // namespace

std::vector<ProfileProblem> problems(const Profile& profile, std::span<const std::uint32_t> nodes) {
  std::vector<ProfileProblem> found;
  add_id_problems(profile, found);
  const auto check_unit = [&](const char* field, double unit) {
    if (!(std::isfinite(unit) && unit > 0)) found.push_back({field, "must be a positive number"});
  };
  check_unit("current_unit_a", profile.current_unit_a);
  check_unit("voltage_unit_v", profile.voltage_unit_v);
  check_unit("bus_voltage_unit_v", profile.bus_voltage_unit_v);
  check_unit("speed_unit_rad_s", profile.speed_unit_rad_s);
  check_unit("edge_time_unit_s", profile.edge_time_unit_s);
  add_node_problems(profile, nodes, found);
  return found;
}

}  // namespace drivebench::can
