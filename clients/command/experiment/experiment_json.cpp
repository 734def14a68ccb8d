#include "clients/command/experiment/experiment_json.hpp"

#include <fmt/core.h>

#include <vector>

#include "clients/command/common/basics/json.hpp"
#include "clients/command/experiment/experiment_file.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {

Json json_of(const v1::ExperimentInfo& info) {
  Json out{{"id", info.id()},
           {"state", word_of(info.state())},
           {"position", info.position()},
           {"user", info.user()}};
  if (info.period_s() == 0.0) return out;  // of another user: the server says no more
  out["label"] = info.label();
  out["shared"] = info.shared();
  out["mode"] = info.mode() == v1::MODE_REALTIME ? "realtime" : "free";
  out["ticks"] = info.ticks();
  out["tick"] = info.tick();
  out["rows"] = info.rows();
  out["decimation"] = info.decimation();
  out["period_s"] = info.period_s();
  out["signals"] = std::vector<std::string>(info.signals().begin(), info.signals().end());
  out["reason"] = info.reason();
  if (info.has_verdict()) {
    out["state_hash"] = fmt::format("{:016x}", info.verdict().state_hash());
    out["late_ticks"] = info.verdict().late_ticks();
    out["sentence"] = info.verdict().sentence();
  }
  return out;
}

std::string experiment_json(const v1::ExperimentInfo& info, std::string_view out_file,
                            std::uint64_t resumed) {
  Json out = json_of(info);
  out["out"] = out_file;
  out["resumed"] = resumed;
  return json_text(out);
}

std::string experiments_json(const v1::ExperimentList& list) {
  Json out = Json::array();
  for (const v1::ExperimentInfo& info : list.experiments())
    out.push_back(json_of(info));
  return json_text(Json{{"experiments", out}}, 2);
}

}  // namespace drivebench::command
