#include "server/access/address.hpp"

#include <algorithm>

#include "server/host/asio.hpp"

namespace drivebench {

std::string address_of(const Client& client) {
  boost::system::error_code error;
  const asio::ip::address address =
      asio::ip::make_address(client.peer.substr(0, client.peer.rfind(':')), error);
  if (error) return client.transport;
  if (address.is_v4()) return address.to_string();
  const asio::ip::address_v6 v6 = address.to_v6();
  if (v6.is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, v6).to_string();
  asio::ip::address_v6::bytes_type bytes = v6.to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), static_cast<unsigned char>(0));
  return asio::ip::address_v6(bytes).to_string();
}

}  // namespace drivebench
