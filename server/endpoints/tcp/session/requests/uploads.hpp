#pragma once

#include <cstdint>
#include <map>
#include <memory>

#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/experiments/table.hpp"

namespace drivebench {

/// The tables that a session has uploaded for its experiments. They end with the session.
class Uploads {
 public:
  explicit Uploads(Dialogue& dialogue) : dialogue_(dialogue) {}

  /// Appends rows to a table, or begins a new one.
  void upload(const v1::UploadTable& request);
  /// The table with this number; null if there is none.
  std::shared_ptr<const SignalTable> find(std::uint64_t number) const;
  void clear() { tables_.clear(); }

 private:
  void append(Experiments& experiments, const v1::UploadTable& request);
  void check(const v1::UploadTable& request) const;

  Dialogue& dialogue_;
  std::map<std::uint64_t, std::shared_ptr<SignalTable>> tables_;  // by number
  std::uint64_t last_table_ = 0;
};

}  // namespace drivebench
