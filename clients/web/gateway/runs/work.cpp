#include "clients/web/gateway/runs/work.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <system_error>

#include "clients/web/gateway/reports/report_folder.hpp"
#include "protocols/json.hpp"

namespace drivebench::web {
namespace {

namespace fs = std::filesystem;

// No program of a suite gets the secrets of the gateway.
const std::vector<std::string> kNoSecrets = {"DRIVEBENCH_TOKEN=", "DRIVEBENCH_OWNER="};

/// A private folder beside the reports, so that a finished file moves there in one step. Its name is none of
/// a report.
class WorkFolder {
 public:
  explicit WorkFolder(const fs::path& reports) {
    std::string name = (reports / ".run-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr)
      throw std::system_error(errno, std::generic_category(), reports.string());
    path_ = name;
  }
  ~WorkFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;

  fs::path file(std::string_view name) const { return path_ / name; }

 private:
  fs::path path_;
};

/// `servo-20261127-234501`, or the next name of which there is no report.
std::string free_name(const fs::path& reports, const std::string& subject) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> date{};
  std::strftime(date.data(), date.size(), "%Y%m%d-%H%M%S", &utc);
  const std::string first = fmt::format("{}-{}", subject, date.data());
  const auto is_free = [&reports](const std::string& name) {
    return std::ranges::none_of(kReportTypes, [&](const auto& type) {
      return fs::exists(fs::symlink_status(reports / (name + std::string(type.first))));
    });
  };
  std::string name = first;
  for (int next = 2; !is_free(name); ++next)
    name = fmt::format("{}-{}", first, next);
  return name;
}

/// Without the private folder, whose name tells a browser nothing.
std::string sentence_of(const VerbEnd& end, std::string_view verb, const WorkFolder& folder) {
  if (end.complaint.empty()) return fmt::format("drivebench {} ended with code {}", verb, end.code);
  std::string sentence = end.complaint;
  const std::string path = folder.file("").string();
  for (std::size_t at = sentence.find(path); at != std::string::npos; at = sentence.find(path))
    sentence.erase(at, path.size());
  return sentence;
}

bool begins_with_one_of(std::string_view line, std::initializer_list<std::string_view> words) {
  return std::ranges::any_of(words, [line](std::string_view word) {
    return line.starts_with(word) && line.substr(word.size()).starts_with(' ');
  });
}

/// Whether a file was written to its end. A full disk leaves a part of it.
bool ends_with(const fs::path& path, std::string_view end) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(-static_cast<std::streamoff>(end.size()), std::ios::end);
  std::string last(end.size(), ' ');
  return file.read(last.data(), static_cast<std::streamsize>(last.size())) && last == end;
}

/// The verdict in a report of `drivebench identify`; nothing: it is another text, such as an error.
std::optional<std::string> verdict_of(std::string_view text) {
  try {
    const nlohmann::json report = parse_json(text);
    if (report.is_object() && report.contains("parameters")) return report.value("verdict", "");
  } catch (const nlohmann::json::exception&) {
    // Nothing is made of what is no report.
  }
  return std::nullopt;
}

/// Moves the picture before the report: a report that the page lists has its picture.
void keep_identification(const WorkFolder& folder, const fs::path& picture, const std::string& report,
                         const fs::path& place) {
  const fs::path file = folder.file("report.json");
  std::ofstream out(file, std::ios::binary);
  out << report;
  out.close();
  if (!out) throw std::system_error(errno, std::generic_category(), "the report");
  if (ends_with(picture, "</svg>\n")) fs::rename(picture, place.string() + ".svg");
  fs::rename(file, place.string() + ".json");
}

}  // namespace

WorkEnd run_suite(const RunPlaces& places, const SuiteWork& work, const SeeCounts& see,
                  const std::stop_token& stop) {
  const WorkFolder folder(places.reports);
  CaseCounts counts;
  const VerbEnd listed = places.verb(
      {.arguments = {"test", "--list", work.folder.string()},
       .environment = kNoSecrets,
       .complaints = folder.file("complaints")},
      [&counts](std::string_view) { ++counts.of; }, stop);
  if (listed.code != 0) return {.sentence = sentence_of(listed, "test --list", folder)};
  see(counts);

  const fs::path page = folder.file("report.html");
  std::string last;
  const auto see_line = [&](std::string_view line) {
    last = line.substr(0, kLongestSentence);
    const bool is_good = begins_with_one_of(line, {"pass", "skipped"});
    if (!is_good && !begins_with_one_of(line, {"fail", "error", "invalid"})) return;
    ++counts.done;
    counts.bad += is_good ? 0 : 1;
    see(counts);
  };
  const VerbEnd end = places.verb({.arguments = {"test", "--html", page.string(), work.folder.string()},
                                   .environment = kNoSecrets,
                                   .complaints = folder.file("complaints")},
                                  see_line, stop);
  if (stop.stop_requested() || !ends_with(page, "</html>\n"))
    return {.sentence = sentence_of(end, "test", folder)};
  std::string name = free_name(places.reports, work.name) + ".html";
  fs::rename(page, places.reports / name);
  return {.is_good = end.code == 0, .sentence = last, .report = std::move(name)};
}

WorkEnd identify(const RunPlaces& places, const IdentificationWork& work, const std::stop_token& stop) {
  const WorkFolder folder(places.reports);
  const std::string recording = fmt::format("experiment-{}.mcap", work.experiment);
  const VerbEnd fetched = places.verb(
      {.arguments = {"experiment", "fetch", std::to_string(work.experiment), "--link", places.bench, "--out",
                     folder.file(recording).string()},
       .environment = {"DRIVEBENCH_TOKEN=" + places.bench_token, "DRIVEBENCH_OWNER=" + work.owner},
       .complaints = folder.file("complaints")},
      [](std::string_view) {}, stop);
  if (fetched.code != 0) return {.sentence = sentence_of(fetched, "experiment fetch", folder)};

  std::string report;
  bool is_too_large = false;
  const auto see_line = [&](std::string_view line) {
    is_too_large = is_too_large || report.size() + line.size() >= ReportFolder::kMostBytes;
    if (!is_too_large) report.append(line) += '\n';
  };
  // It starts in the folder: the report names its source as it was told.
  const VerbEnd end = places.verb({.arguments = {"identify", "--motor=" + work.motor, "--axis=" + work.axis,
                                                 "--from", recording, "--json", "--plot", "plot.svg"},
                                   .environment = kNoSecrets,
                                   .complaints = folder.file("complaints"),
                                   .folder = folder.file("")},
                                  see_line, stop);
  if (is_too_large) return {.sentence = "the report is larger than a report may be"};
  const std::optional<std::string> verdict = verdict_of(report);
  if (stop.stop_requested() || !verdict) return {.sentence = sentence_of(end, "identify", folder)};

  const std::string name =
      free_name(places.reports, fmt::format("experiment-{}-{}", work.experiment, work.motor));
  keep_identification(folder, folder.file("plot.svg"), report, places.reports / name);
  return {.is_good = end.code == 0, .sentence = *verdict, .report = name + ".json"};
}

}  // namespace drivebench::web
