#include "server/endpoints/tcp/session/requests/uploads.hpp"

#include <fmt/core.h>

#include <cmath>

#include "server/endpoints/tcp/session/requests/experiment_requests.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMaxTables = 64;

/// The rows of a message, which must be later than `last_s`. Throws BadRequest.
std::vector<SignalTable::Row> rows_of(const v1::UploadTable& r, double last_s) {
  std::vector<SignalTable::Row> rows;
  rows.reserve(static_cast<std::size_t>(r.times_s_size()));
  for (int i = 0; i < r.times_s_size(); ++i) {
    const std::uint64_t number = r.first() + static_cast<std::uint64_t>(i);
    if (!std::isfinite(r.times_s(i)) || r.times_s(i) <= last_s || r.times_s(i) < 0.0) {
      throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, fmt::format("times_s[{}]", i),
                       fmt::format("the time {} of row {} must be finite, not negative and later than that "
                                   "before it",
                                   r.times_s(i), number));
    }
    if (!(std::abs(r.values(i)) <= kMaxInputValue)) {
      throw BadRequest(
          v1::REFUSAL_OUT_OF_RANGE, fmt::format("values[{}]", i),
          fmt::format("the value {} of row {} must lie between -1e6 and 1e6", r.values(i), number));
    }
    last_s = r.times_s(i);
    rows.push_back({.time_s = r.times_s(i), .value = r.values(i)});
  }
  return rows;
}

}  // namespace

std::shared_ptr<const SignalTable> Uploads::find(std::uint64_t number) const {
  const auto found = tables_.find(number);
  return found == tables_.end() ? nullptr : found->second;
}

void Uploads::upload(const v1::UploadTable& r) {
  with_experiments(dialogue_, [&](Experiments& experiments) { append(experiments, r); });
}

/// Throws BadRequest if the numbers of times and values differ, the table does not exist, or the session has
/// too many tables.
void Uploads::check(const v1::UploadTable& r) const {
  if (r.times_s_size() != r.values_size()) {
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "values",
                     fmt::format("there are {} times but {} values", r.times_s_size(), r.values_size()));
  }
  if (r.table() != 0 && !tables_.contains(r.table())) {
    throw BadRequest(v1::REFUSAL_UNKNOWN_TABLE, "table",
                     fmt::format("this session has no table {}", r.table()));
  }
  if (r.table() == 0 && tables_.size() >= kMaxTables) {
    throw BadRequest(v1::REFUSAL_BUSY, "table",
                     fmt::format("this session has {} tables, as many as may be", kMaxTables));
  }
}

void Uploads::append(Experiments& experiments, const v1::UploadTable& r) {
  check(r);
  const std::shared_ptr<SignalTable> table = r.table() == 0 ? experiments.new_table() : tables_.at(r.table());
  if (r.first() != table->size()) {
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "first",
                     fmt::format("first is {} but must be {}, the next row", r.first(), table->size()));
  }
  std::uint64_t rows = static_cast<std::uint64_t>(r.times_s_size());
  experiments.check_rows(rows);
  for (const auto& [number, other] : tables_)
    rows += other->size();
  if (rows > experiments.max_table_rows()) {
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "times_s",
                     fmt::format("the tables of this session come to {} rows but may have {}", rows,
                                 experiments.max_table_rows()));
  }
  table->append(rows_of(r, table->size() == 0 ? -1.0 : table->last_time_s()));
  const std::uint64_t number = r.table() == 0 ? ++last_table_ : r.table();
  tables_[number] = table;
  v1::TableInfo& info = *dialogue_.begin_reply(dialogue_.id()).mutable_table_info();
  info.set_table(number);
  info.set_rows(table->size());
  dialogue_.send_reply();
}

}  // namespace drivebench
