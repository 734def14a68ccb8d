#include "server/endpoints/modbus/identification.hpp"

#include "server/host/build_id.hpp"

namespace drivebench::modbus {
namespace {

// All objects together fit into one PDU of 253 bytes.
constexpr std::size_t kMaxText = 24;
constexpr std::uint8_t kBasicObjects = 3;
constexpr std::uint8_t kRegularWithIndividual = 0x82;  // conformity level
enum ReadCode : std::uint8_t { kBasic = 1, kRegular = 2, kExtended = 3, kIndividual = 4 };

}  // namespace

Identification::Identification(const std::string& bench)
    : objects_{"drivebench", "drivebench-server", std::string(build_id()),
               "",           "drivebench",        "electric drive bench",
               bench} {
  for (std::string& text : objects_)
    text.resize(std::min(text.size(), kMaxText));
}

std::vector<std::uint8_t> Identification::answer(std::span<const std::uint8_t> pdu) const {
  const std::uint8_t code = pdu[2];
  const std::size_t known = code == kBasic ? kBasicObjects : objects_.size();
  std::size_t first = pdu[3];
  std::size_t end = known;
  if (first >= known) {
    if (code == kIndividual) return {};
    first = 0;  // the specification asks for it
  }
  if (code == kIndividual) end = first + 1;
  std::vector<std::uint8_t> answer{
      pdu[0], pdu[1], code, kRegularWithIndividual, 0, 0, static_cast<std::uint8_t>(end - first)};
  for (std::size_t i = first; i < end; ++i) {
    answer.push_back(static_cast<std::uint8_t>(i));
    answer.push_back(static_cast<std::uint8_t>(objects_[i].size()));
    answer.insert(answer.end(), objects_[i].begin(), objects_[i].end());
  }
  return answer;
}

}  // namespace drivebench::modbus
