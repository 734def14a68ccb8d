#include "clients/web/gateway/doors/listen_address.hpp"

#include <arpa/inet.h>

#include <charconv>

#include "protocols/text.hpp"

namespace drivebench::web {
namespace {

[[noreturn]] void refuse(std::string_view text, std::string_view rule) {
  throw StartError("--listen " + printable(text) + ": " + std::string(rule));
}

}  // namespace

ListenAddress parse_listen_address(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) refuse(text, "expected ADDRESS:PORT, such as 127.0.0.1:7380");
  std::string_view host = text.substr(0, colon);
  const std::string_view port = text.substr(colon + 1);
  ListenAddress address;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), address.port);
  if (error != std::errc{} || end != port.data() + port.size()) {
    refuse(text, "the port must be a number from 0 to 65535");
  }
  if (host == "localhost") host = "127.0.0.1";
  const bool has_brackets = host.starts_with('[') && host.ends_with(']');
  if (has_brackets) host = host.substr(1, host.size() - 2);
  address.host = host;
  in_addr v4 = {};
  in6_addr v6 = {};
  if (!has_brackets && ::inet_pton(AF_INET, address.host.c_str(), &v4) == 1) {
    address.is_loopback = (ntohl(v4.s_addr) >> 24) == 127;
  } else if (has_brackets && ::inet_pton(AF_INET6, address.host.c_str(), &v6) == 1) {
    address.is_loopback = IN6_IS_ADDR_LOOPBACK(&v6);
  } else {
    refuse(text, "expected an IP address in front of the port, an IPv6 one in brackets");
  }
  return address;
}

std::string to_string(const ListenAddress& address) {
  const bool is_ipv6 = address.host.find(':') != std::string::npos;
  return (is_ipv6 ? "[" + address.host + "]" : address.host) + ":" + std::to_string(address.port);
}

}  // namespace drivebench::web
