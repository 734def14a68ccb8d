#include "clients/link/can/can_versions.hpp"

#include "protocols/can/codec.hpp"

namespace drivebench::link {
namespace {

can::IdSet other_set(can::IdSet set) {
  return set == can::IdSet::kFree ? can::IdSet::kCanopen : can::IdSet::kFree;
}

/// The same profile with the default identifiers of the other set.
can::Profile other_profile(can::Profile profile) {
  profile.choose_ids(other_set(profile.id_set), profile.extended);
  return profile;
}

bool has_version(can::IdSet set, unsigned version) {
  return version == can::version_of(set, false) || version == can::version_of(set, true);
}

}  // namespace

std::vector<std::uint32_t> heard_ids(const CanAddress& address) {
  std::vector<std::uint32_t> ids;
  for (const can::MessageRow& row : can::kMessages) {
    if (row.sender == can::Sender::kBench) ids.push_back(address.profile.id_of(row, address.node));
  }
  const can::MessageRow& heartbeat = *can::find_message(can::Message::kHeartbeat, address.profile.fd);
  ids.push_back(other_profile(address.profile).id_of(heartbeat, address.node));
  return ids;
}

std::optional<unsigned> other_version_in(const can::Frame& frame, const can::Profile& profile,
                                         std::uint32_t node) {
  const can::Profile other = other_profile(profile);
  const can::Match match = can::match(other, frame);
  if (!match.ok() || match.row->message != can::Message::kHeartbeat || match.node != node)
    return std::nullopt;
  const can::Values values = can::decode(*match.row, other, frame);
  const auto version =
      static_cast<unsigned>(values[can::index_of(can::Message::kHeartbeat, other.fd, "profile")]);
  if (!has_version(other.id_set, version)) return std::nullopt;
  return version;
}

std::string other_version_text(unsigned version, const can::Profile& profile) {
  std::string text = "speaks version " + std::to_string(version) +
                     " of the profile, this program here versions " +
                     std::to_string(can::version_of(profile.id_set, false)) + " and " +
                     std::to_string(can::version_of(profile.id_set, true));
  const can::IdSet other = other_set(profile.id_set);
  if (has_version(other, version)) {
    text += "; the address must say identifiers=" +
            std::string(can::kIdSetNames[static_cast<std::size_t>(other)]);
  }
  return text;
}

}  // namespace drivebench::link
