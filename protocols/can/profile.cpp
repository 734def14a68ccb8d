#include "protocols/can/profile.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "protocols/can/frame.hpp"

namespace drivebench::can {
namespace {

constexpr bool ids_are_sorted_and_disjoint(bool fd) {
  IdRange before{0, 0};
  std::optional<Message> message;
  for (const MessageRow& row : kMessages) {
    if (!is_in(row, fd)) continue;
    const IdRange ids = ids_of(row, row.base_id);
    if (row.message == message && ids.first == before.first) continue;  // narrow and wide rows
    if (ids.first < (message ? before.last + 1 : 0) || ids.last > kMaxStandardId) return false;
    before = ids;
    message = row.message;
  }
  return true;
}

static_assert(ids_are_sorted_and_disjoint(false) && ids_are_sorted_and_disjoint(true));

void add_id_problems(const Profile& profile, std::vector<ProfileProblem>& found) {
  const std::uint32_t limit = profile.extended ? kMaxExtendedId : kMaxStandardId;
  std::vector<const MessageRow*> seen;
  std::optional<Message> before;
  for (const MessageRow& row : kMessages) {
    // A message of narrow and wide axes has two rows.
    if (!is_on(row, profile) || std::exchange(before, row.message) == row.message) continue;
    const std::string field = "ids." + std::string(row.name);
    const std::uint32_t base_id = profile.base_ids[static_cast<std::size_t>(row.message)];
    const std::uint32_t largest = limit - (row.per_node ? kMaxNode : 0);
    if (base_id > largest) {
      found.push_back({field, "must be at most " + std::to_string(largest) +
                                  (row.per_node ? ", as node ids up to 127 are added to it" : "")});
      continue;
    }
    const IdRange ids = ids_of(row, base_id);
    for (const MessageRow* other : seen) {
      const IdRange others = ids_of(*other, profile.base_ids[static_cast<std::size_t>(other->message)]);
      if (ids.first > others.last || others.first > ids.last) continue;
      found.push_back(
          {field, "must keep its identifiers apart from those of ids." + std::string(other->name)});
    }
    seen.push_back(&row);
  }
}

void add_node_problems(std::span<const std::uint32_t> nodes, std::vector<ProfileProblem>& found) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const auto before = nodes.first(i);
    if (nodes[i] < 1 || nodes[i] > kMaxNode)
      found.push_back({"node", "must be 1 to 127, not " + std::to_string(nodes[i])});
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
  add_node_problems(nodes, found);
  return found;
}

}  // namespace drivebench::can
