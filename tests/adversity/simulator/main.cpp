// drivebench-simulator: the server against seeded adversity, in virtual time.
#include <malloc.h>

#include <google/protobuf/stubs/logging.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <iterator>
#include <string>
#include <string_view>

#include "server/host/logging/log.hpp"
#include "tests/adversity/simulator/week.hpp"
#include "tests/adversity/simulator/world/world.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::simulator {
namespace {

constexpr const char* kUsage =
    "usage: drivebench-simulator --seeds A..B [--seconds S] [--twice] [--trace]\n"
    "       drivebench-simulator --week | --minutes M\n"
    "\n"
    "  --seeds A..B  these seeds, or one: --seeds A\n"
    "  --seconds S   of virtual time for each, 10 if not given\n"
    "  --twice       each seed twice, which must give the same events\n"
    "  --week        the servo axis alone for a week of plant time under random faults, as fast as possible\n"
    "  --minutes M   the same for so many minutes\n"
    "  --trace       print every event, and what each seed takes\n";

struct Options {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
  Time duration = 10 * kSecond;
  bool twice = false;
  bool trace = false;
  std::uint64_t minutes = 0;
};

bool read_number(std::string_view text, std::uint64_t& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

bool read_seeds(std::string_view text, Options& o) {
  const std::size_t dots = text.find("..");
  if (dots == std::string_view::npos) return read_number(text, o.first) && read_number(text, o.last);
  return read_number(text.substr(0, dots), o.first) && read_number(text.substr(dots + 2), o.last) &&
         o.first <= o.last;
}

/// The mistake in the command line; empty: none.
std::string read_options(int argc, char** argv, Options& o) {
  bool seeds = false;
  bool for_seeds_only = false;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const std::string_view next = i + 1 < argc ? argv[i + 1] : "";
    std::uint64_t seconds = 0;
    if (word == "--seeds" && read_seeds(next, o)) {
      seeds = true;
      ++i;
    } else if (word == "--seconds" && read_number(next, seconds) && seconds > 0 && seconds < 100'000) {
      o.duration = static_cast<Time>(seconds) * kSecond;
      for_seeds_only = true;
      ++i;
    } else if (word == "--minutes" && read_number(next, o.minutes) && o.minutes > 0 && o.minutes < 100'000) {
      ++i;
    } else if (word == "--week") {
      o.minutes = 7 * 24 * 60;
    } else if (word == "--twice") {
      o.twice = for_seeds_only = true;
    } else if (word == "--trace") {
      o.trace = for_seeds_only = true;
    } else if (word == "--seeds" || word == "--seconds" || word == "--minutes") {
      return std::string(word) + " does not take '" + std::string(next) + "'";
    } else {
      return "'" + std::string(word) + "' is no option";
    }
  }
  if (seeds == (o.minutes > 0)) return "either --seeds, or --week or --minutes";
  if (!seeds && for_seeds_only) return "--seconds, --twice and --trace belong to --seeds";
  return "";
}

Outcome run_seed(std::uint64_t seed, const Options& o) {
  const TestFolder folder;
  World world(seed, o.trace, (folder / ".").parent_path().string());
  return world.run(o.duration);
}

/// `first`: the first of the seeds that are needed to see the failure again.
void print_failure(const Outcome& outcome, std::uint64_t first, const Options& o) {
  const std::string range = first == outcome.seed ? "" : std::to_string(first) + "..";
  std::printf(
      "seed %llu (%s; %s): broken at %.6f s: %s\n%s  again: ./bench simulate --seeds %s%llu --seconds "
      "%lld%s\n",
      static_cast<unsigned long long>(outcome.seed), outcome.bench.c_str(), outcome.players.c_str(),
      static_cast<double>(outcome.failure.time) * 1e-9, outcome.failure.promise.c_str(), outcome.tail.c_str(),
      range.c_str(), static_cast<unsigned long long>(outcome.seed),
      static_cast<long long>(o.duration / kSecond), o.twice ? " --twice" : "");
}

std::ptrdiff_t open_files() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"),
                       std::filesystem::directory_iterator());
}

/// Descriptors and memory that a seed leaves behind in this process.
class Leftovers {
 public:
  std::string problem() {
    const std::size_t memory = ::mallinfo2().uordblks;
    if (++seeds_ <= kWarmUp) most_memory_ = std::max(most_memory_, memory);
    if (open_files() != files_) return "every descriptor is closed";
    return memory > most_memory_ + kSlackBytes ? "memory stays flat from seed to seed" : "";
  }

 private:
  static constexpr std::uint64_t kWarmUp = 10;  ///< tables are made on first use
  static constexpr std::size_t kSlackBytes = std::size_t{4} << 20;

  std::ptrdiff_t files_ = open_files();
  std::uint64_t seeds_ = 0;
  std::size_t most_memory_ = 0;
};

int run(const Options& o) {
  Leftovers leftovers;
  std::uint64_t failed = 0;
  std::uint64_t ticks = 0;
  std::uint64_t events = 0;
  for (std::uint64_t seed = o.first; seed <= o.last; ++seed) {
    Outcome outcome = run_seed(seed, o);
    if (o.twice && outcome.failure.promise.empty() && run_seed(seed, o).hash != outcome.hash) {
      outcome.failure.promise = "the same seed gives the same events";
    }
    if (o.trace) {
      std::printf("seed %llu (%s; %s): %llu ticks, %llu events, hash %016llx\n",
                  static_cast<unsigned long long>(seed), outcome.bench.c_str(), outcome.players.c_str(),
                  static_cast<unsigned long long>(outcome.ticks),
                  static_cast<unsigned long long>(outcome.events),
                  static_cast<unsigned long long>(outcome.hash));
    }
    const std::string left = leftovers.problem();
    const bool by_itself = !outcome.failure.promise.empty() || left.empty();
    if (!by_itself) outcome.failure.promise = left;  // of this seed, or of those before it
    ticks += outcome.ticks;
    events += outcome.events;
    if (!outcome.failure.promise.empty()) {
      ++failed;
      print_failure(outcome, by_itself ? seed : o.first, o);
    }
    std::fflush(stdout);
  }
  std::printf("%llu seeds of %lld s: %llu failed; %llu ticks, %llu events, %.1f s of CPU\n",
              static_cast<unsigned long long>(o.last - o.first + 1),
              static_cast<long long>(o.duration / kSecond), static_cast<unsigned long long>(failed),
              static_cast<unsigned long long>(ticks), static_cast<unsigned long long>(events),
              static_cast<double>(std::clock()) / CLOCKS_PER_SEC);
  return failed == 0 ? 0 : 1;
}

}  // namespace
}  // namespace drivebench::simulator

int main(int argc, char** argv) {
  drivebench::simulator::Options options;
  if (const std::string wrong = drivebench::simulator::read_options(argc, argv, options); !wrong.empty()) {
    std::fprintf(stderr, "drivebench-simulator: %s\n%s", wrong.c_str(), drivebench::simulator::kUsage);
    return 2;
  }
  std::signal(SIGPIPE, SIG_IGN);
  drivebench::log::set_level(drivebench::LogLevel::kOff);
  google::protobuf::SetLogHandler(nullptr);
  if (options.minutes > 0) return drivebench::simulator::run_long(options.minutes * 60, 1);
  return drivebench::simulator::run(options);
}
