#pragma once

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

/// The results of the book's control experiments in drivebench: the contents of RESULTS.md.
namespace drivebench {

/// A number that an experiment gave. Another machine may differ by the tolerance: loops with an encoder are
/// chaotic in their last digits, and no two C libraries round alike.
struct Measured {
  std::string what;
  double value;
  std::string unit;
  double tolerance;
};

/// 2 %.
inline Measured number(std::string what, double value, std::string unit) {
  return {std::move(what), value, std::move(unit), 0.02 * std::abs(value) + 1e-9};
}
/// Half a count and 5 %: the steps of the encoder.
inline Measured counts(std::string what, double value) {
  return {std::move(what), value, "counts", 0.5 + 0.05 * std::abs(value)};
}
/// A failed run fails differently each time: half.
inline Measured failing(std::string what, double value, std::string unit) {
  return {std::move(what), value, std::move(unit), 0.5 * std::abs(value)};
}

/// A row of the table.
struct Result {
  std::string number;  ///< of the case in the acceptance list
  std::string experiment;
  std::string book;  ///< the book's value, or one derived from it and marked so
  std::vector<Measured> measured;
  std::string why;  ///< the reason of a difference, or "agrees"
};

struct ResultSection {
  std::string title;
  std::vector<Result> results;
};

ResultSection field_oriented_results();
ResultSection high_speed_results();
ResultSection optimum_torque_results();
ResultSection flux_observer_results();
ResultSection transformer_results();
ResultSection pm_results();
ResultSection stepper_results();
ResultSection other_synchronous_results();
ResultSection dc_results();
ResultSection wound_dc_results();
ResultSection steady_state_results();
ResultSection identification_results();
ResultSection classical_results();

/// All of them; runs every experiment.
std::vector<ResultSection> all_results();

std::string markdown_of(const std::vector<ResultSection>& sections);

/// The places where a text differs from markdown_of(sections) by more than the tolerances, a sentence each.
std::vector<std::string> differences(const std::string& text, const std::vector<ResultSection>& sections);

}  // namespace drivebench
