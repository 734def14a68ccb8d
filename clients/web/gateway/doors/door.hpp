#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/web/gateway/doors/listen_address.hpp"

namespace drivebench::web {

/// What decides whether a request comes in.
struct Door {
  ListenAddress address;  ///< with the port that the system chose
  bool tls = false;
  std::string token{};  ///< empty: none is asked for
  std::vector<std::string>
      foxglove_origins{};  ///< other sites whose pages may read through Foxglove's socket
};

/// The headers of a request that the door looks at; empty: absent.
struct Visitor {
  std::string_view host;
  std::string_view origin;
  std::string_view authorization;
  bool is_foxglove = false;  ///< the request is for Foxglove's WebSocket, which only reads
};

struct DoorRefusal {
  unsigned status = 403;  ///< of HTTP
  std::string_view name;  ///< in the metrics
  std::string_view sentence;
};

/// The reason why the visitor stays outside; nothing: the visitor comes in.
///
/// On loopback the host must be a name of loopback, so that no foreign name that leads here (DNS rebinding)
/// becomes an origin of this page. A browser names the origin of every WebSocket: it must be this page, or
/// for Foxglove's socket one of the allowed. The token comes as Bearer or as the password of Basic, for which
/// a browser asks its user.
std::optional<DoorRefusal> refusal_of(const Door& door, const Visitor& visitor);

/// Whether the text is an origin as browsers write it: SCHEME://HOST, SCHEME://HOST:PORT or file://.
bool is_origin(std::string_view text);

}  // namespace drivebench::web
