#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace drivebench::regression {

/// One of several runs that share the cases of a suite: every `count`-th case, beginning with number `index`.
struct Shard {
  std::size_t index = 1;  ///< from 1
  std::size_t count = 1;

  bool has(std::size_t place) const noexcept { return place % count == index - 1; }
};

/// Reads the environment: the value of a variable, or null.
using Environment = std::function<const char*(const char*)>;

/// `2/4`, or `auto`: as the environment says, which is that of an array of Slurm, of `parallel` of GitLab, or
/// of an indexed job of Kubernetes with DRIVEBENCH_SHARDS beside it. Throws std::invalid_argument with the
/// rule that the text or a variable breaks.
Shard shard_of(std::string_view text, const Environment& environment);

}  // namespace drivebench::regression
