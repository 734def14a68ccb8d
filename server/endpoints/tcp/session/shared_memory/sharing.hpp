#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "server/endpoints/tcp/session/dialogue.hpp"

namespace drivebench {

/// Whether the session may share memory now; else the request is refused.
bool may_share(Dialogue& dialogue, std::uint32_t spin_us, bool shares_already);

/// Answers with so many bytes of memory. `send` takes bytes and sends some of them with the descriptors of
/// the memory; it returns their number, or -1 with errno. Throws std::system_error if it sends none.
void answer_with_memory(Dialogue& dialogue, std::size_t bytes,
                        const std::function<std::ptrdiff_t(std::span<const std::byte>)>& send);

}  // namespace drivebench
