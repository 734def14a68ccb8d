#include "clients/command/common/basics/signals.hpp"

#include <fmt/format.h>

#include <iterator>

#include "clients/command/common/basics/errors.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {

std::vector<const Signal*> signals_named(const std::vector<std::string>& names) {
  std::vector<const Signal*> signals;
  for (const std::string& name : names) {
    const Signal* const signal = find_signal(name);
    if (name == "time_s") throw UsageError("time_s is no signal: it stands beside the tick anyway");
    if (signal == nullptr) {
      throw UsageError(fmt::format("no signal '{}'{}; `drivebench describe` lists them", printable(name),
                                   did_you_mean(name, kSignals, &Signal::name)));
    }
    signals.push_back(signal);
  }
  return signals;
}

std::vector<std::string> without_time(std::vector<std::string> names) {
  std::erase_if(names, [](const std::string& name) { return name == "tick" || name == "time_s"; });
  return names;
}

std::string csv_header(const std::vector<const Signal*>& signals, std::string_view further_times) {
  std::string header = fmt::format("tick,time_s{}", further_times);
  for (const Signal* signal : signals)
    header += fmt::format(",{} [{}]", signal->name, signal->unit);
  return header + "\n";
}

void append_time(std::string& csv, std::uint64_t tick, std::uint64_t time_ns) {
  fmt::format_to(std::back_inserter(csv), "{},{}.{:09}", tick, time_ns / 1'000'000'000,
                 time_ns % 1'000'000'000);
}

}  // namespace drivebench::command
