#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "clients/web/gateway/runs/verb.hpp"

namespace drivebench::web {

/// Where runs find what they need.
struct RunPlaces {
  std::filesystem::path reports;  ///< absolute; their results go there
  std::string bench;              ///< its address
  std::string bench_token;        ///< of the gateway
  RunVerb verb;
};

struct SuiteWork {
  std::string name{};
  std::filesystem::path folder{};
};

/// Identifies the motor of an experiment of the bench from its recording.
struct IdentificationWork {
  std::uint64_t experiment = 0;
  std::string owner{};  ///< the secret that opens the recording
  std::string axis{};   ///< by name
  std::string motor{};  ///< the kind, as `drivebench identify` names it
};

/// Cases of a suite.
struct CaseCounts {
  std::size_t done = 0;
  std::size_t of = 0;   ///< 0: not known yet
  std::size_t bad = 0;  ///< neither passed nor skipped
};
using SeeCounts = std::function<void(const CaseCounts&)>;

inline constexpr std::size_t kLongestSentence = 500;

struct WorkEnd {
  bool is_good = false;
  std::string sentence{};  ///< the program's last
  std::string report{};    ///< its name in the folder; empty: there is none
};

/// Both work in a private folder in that of the reports and move what is complete: a report is never a part
/// of one. Throw std::system_error and std::filesystem::filesystem_error.
WorkEnd run_suite(const RunPlaces& places, const SuiteWork& work, const SeeCounts& see,
                  const std::stop_token& stop);
WorkEnd identify(const RunPlaces& places, const IdentificationWork& work, const std::stop_token& stop);

}  // namespace drivebench::web
