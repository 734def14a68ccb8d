#include "clients/command/doctor/doctor.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "protocols/json.hpp"
#include "protocols/pages/help_text.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

const char* health_word(Health health) {
  constexpr std::array kWords = {"fine", "note", "problem"};
  return kWords[static_cast<std::size_t>(health)];
}

void print_table(const char* title, const std::vector<HostFinding>& findings) {
  fmt::print("{}\n", title);
  constexpr std::size_t kColumn = 25;  // of the sentences
  for (const HostFinding& f : findings) {
    fmt::print("  {:<8}{:<14} {}", health_word(f.health), printable(f.name),
               pages::wrapped(fmt::format("{}; {}", printable(f.what), f.why), kColumn));
    if (!f.mend.empty()) fmt::print("{:{}}{}", "", kColumn, pages::wrapped("Mend: " + f.mend, kColumn));
  }
}

Json json_of(const std::vector<HostFinding>& findings) {
  Json list = Json::array();
  for (const HostFinding& f : findings)
    list.push_back({{"health", health_word(f.health)},
                    {"name", f.name},
                    {"what", f.what},
                    {"why", f.why},
                    {"mend", f.mend}});
  return list;
}

std::ptrdiff_t problems_in(const std::vector<HostFinding>& findings) {
  return std::ranges::count(findings, Health::kProblem, &HostFinding::health);
}

}  // namespace

int run_doctor(const DoctorOptions& options) {
  const std::filesystem::path root(options.root);
  if (!std::filesystem::is_directory(root / "proc"))
    throw UsageError(fmt::format("--root {} has no folder proc", printable(options.root)));
  HostFacts facts = read_host(root);
  if (root == "/" && options.measure_s > 0.0)
    measure_host(facts, options.measure_s, static_cast<std::int64_t>(options.period_us * 1e3));
  const std::vector<HostFinding> realtime = realtime_findings(facts, options.period_us);
  const std::vector<HostFinding> can = can_host_findings(facts, options.classic);
  const std::ptrdiff_t problems = problems_in(realtime) + problems_in(can);
  if (options.json) {
    const Json all = {{"problems", problems}, {"realtime", json_of(realtime)}, {"can", json_of(can)}};
    fmt::print("{}\n", json_text(all, 2));
  } else {
    print_table("real time", realtime);
    print_table("CAN", can);
    fmt::print("{}\n", problems == 0 ? "no problems"
                                     : fmt::format("{} problem{}", problems, problems == 1 ? "" : "s"));
  }
  return problems == 0 ? kExitOk : kExitFailed;
}

}  // namespace drivebench::command
