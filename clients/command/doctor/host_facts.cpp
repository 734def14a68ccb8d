#include "clients/command/doctor/host_facts.hpp"

#include <net/if.h>
#include <sys/timex.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;

constexpr int kCapIpcLock = 14;
constexpr int kCapSysNice = 23;
constexpr unsigned kArphrdCan = 280;

/// The first line of a file; empty if it is not there.
std::string line_of_file(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

template <class Number>
std::optional<Number> number_in(std::string_view text, int base = 10) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  return error == std::errc() && end != text.data() ? std::optional(value) : std::nullopt;
}

/// The rest of the line that begins so, without leading blanks.
std::string after(const fs::path& file, std::string_view begin) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(begin)) continue;
    const std::size_t rest = line.find_first_not_of(" \t", begin.size());
    return rest == std::string::npos ? std::string() : line.substr(rest);
  }
  return {};
}

/// The soft limit, in a line of /proc/self/limits.
std::optional<std::uint64_t> limit_of(const fs::path& proc, std::string_view name) {
  const std::string text = after(proc / "self/limits", name);
  if (text.starts_with("unlimited")) return std::numeric_limits<std::uint64_t>::max();
  return number_in<std::uint64_t>(text);
}

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored))
    entries.push_back(entry.path());
  std::ranges::sort(entries);
  return entries;
}

std::vector<std::string> governors_of(const fs::path& cpus) {
  std::vector<std::string> governors;
  for (const fs::path& cpu : entries_of(cpus)) {
    if (std::string governor = line_of_file(cpu / "cpufreq/scaling_governor"); !governor.empty())
      governors.push_back(std::move(governor));
  }
  return governors;
}

/// The CPUs of a list such as "0-2,5".
std::set<unsigned> cpus_in(const std::string& list) {
  constexpr unsigned kMostCpus = 8192;  // of the kernel
  std::set<unsigned> cpus;
  std::istringstream parts(list);
  for (std::string part; std::getline(parts, part, ',');) {
    const std::optional<unsigned> first = number_in<unsigned>(part);
    const std::size_t dash = part.find('-');
    const std::optional<unsigned> last =
        dash == std::string::npos ? first : number_in<unsigned>(part.substr(dash + 1));
    for (unsigned cpu = first.value_or(1); first && last && cpu <= std::min(*last, kMostCpus); ++cpu)
      cpus.insert(cpu);
  }
  return cpus;
}

/// The interrupts that the kernel has directed to one of these CPUs, or that may act there where it does not
/// say.
std::vector<std::string> interrupts_on(const std::set<unsigned>& cpus, const fs::path& irq) {
  std::vector<std::string> found;
  for (const fs::path& folder : entries_of(irq)) {
    std::string list = line_of_file(folder / "effective_affinity_list");
    if (list.empty()) list = line_of_file(folder / "smp_affinity_list");
    if (std::ranges::any_of(cpus_in(list), [&](unsigned cpu) { return cpus.contains(cpu); }))
      found.push_back(folder.filename().string());
  }
  return found;
}

/// Time stolen and time in all, in the first line of /proc/stat.
struct CpuTimes {
  double stolen = 0.0;
  double all = 0.0;
};
CpuTimes cpu_times(const fs::path& proc) {
  constexpr int kSteal = 7;   // user nice system idle iowait irq softirq steal guest guest_nice
  constexpr int kGuests = 8;  // counted in user and nice already
  std::istringstream numbers(after(proc / "stat", "cpu "));
  CpuTimes times;
  double value = 0.0;
  for (int i = 0; i < kGuests && numbers >> value; ++i) {
    times.all += value;
    if (i == kSteal) times.stolen = value;
  }
  return times;
}

double part_stolen(const CpuTimes& from, const CpuTimes& to) {
  return to.all > from.all ? (to.stolen - from.stolen) / (to.all - from.all) : 0.0;
}

/// What /sys has of an interface; the bit timing of a controller is not there.
std::optional<CanInterface> interface_of(const fs::path& folder) {
  const auto number = [&](const char* name, int base = 10) {
    std::string text = line_of_file(folder / name);
    if (text.starts_with("0x")) text.erase(0, 2);
    return number_in<unsigned>(text, base).value_or(0);
  };
  if (number("type") != kArphrdCan) return std::nullopt;
  return CanInterface{.name = folder.filename().string(),
                      .is_can = true,
                      .kind = fs::exists(folder / "device") ? "" : "vcan",
                      .up = (number("flags", 16) & IFF_UP) != 0,
                      .mtu = number("mtu"),
                      .queue_length = number("tx_queue_len"),
                      .controller = {}};
}

void read_can(const fs::path& root, HostFacts& facts) {
  std::error_code ignored;
  facts.has_can = fs::exists(root / "proc/net/can", ignored);
  for (const char* module : {"can", "can_raw", "vcan"}) {
    if (fs::exists(root / "sys/module" / module, ignored)) facts.can_modules.emplace_back(module);
  }
  for (const fs::path& folder : entries_of(root / "sys/class/net")) {
    std::optional<CanInterface> found = interface_of(folder);
    if (!found) continue;
    // The kernel of this machine knows more.
    if (std::optional<CanInterface> whole = root == "/" ? read_can_interface(found->name) : std::nullopt;
        whole)
      found = std::move(whole);
    facts.can_interfaces.push_back(*std::move(found));
  }
}

}  // namespace

HostFacts read_host(const fs::path& root) {
  HostFacts facts;
  const fs::path proc = root / "proc";
  const fs::path cpus = root / "sys/devices/system/cpu";
  facts.realtime_priority = limit_of(proc, "Max realtime priority");
  facts.locked_bytes = limit_of(proc, "Max locked memory");
  const std::uint64_t rights =
      number_in<std::uint64_t>(after(proc / "self/status", "CapEff:"), 16).value_or(0);
  facts.may_schedule = (rights >> kCapSysNice & 1) != 0;
  // As the server has it: the limit does not hold for root, if a container leaves it the right.
  std::istringstream users(after(proc / "self/status", "Uid:"));
  unsigned real_user = 1;
  unsigned effective_user = 1;
  users >> real_user >> effective_user;
  facts.may_lock = effective_user == 0 && (rights >> kCapIpcLock & 1) != 0;
  facts.preempt_rt = line_of_file(root / "sys/kernel/realtime") == "1" ||
                     line_of_file(proc / "version").find("PREEMPT_RT") != std::string::npos;
  facts.governors = governors_of(cpus);
  facts.isolated = line_of_file(cpus / "isolated");
  facts.interrupts_on_isolated = interrupts_on(cpus_in(facts.isolated), proc / "irq");
  facts.clock_source = line_of_file(root / "sys/devices/system/clocksource/clocksource0/current_clocksource");
  facts.steal = part_stolen({}, cpu_times(proc));
  read_can(root, facts);
  return facts;
}

void measure_host(HostFacts& facts, double duration_s, std::int64_t period_ns) {
  const CpuTimes before = cpu_times("/proc");
  facts.wake_ups = measure_wake_ups(duration_s, period_ns);
  facts.steal_now = part_stolen(before, cpu_times("/proc"));
  facts.resolution_ns = clock_resolution_ns();
  timex clock{};
  if (const int state = adjtimex(&clock); state >= 0)
    facts.is_wall_clock_kept = state != TIME_ERROR && (clock.status & STA_UNSYNC) == 0;
}

}  // namespace drivebench::command
