#pragma once

#include <bench.pb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdlib>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "clients/link/common/file_descriptor.hpp"
#include "protocols/framing.hpp"

namespace drivebench::link {

/// The other end of a socket pair: a thread that reads frames and answers with whatever bytes `answer` gives
/// for each request. It ends when the link closes or `answer` gives nothing.
class FakePeer {
 public:
  using Answer = std::function<std::string(const v1::Envelope& request)>;

  explicit FakePeer(Answer answer) {
    std::array<int, 2> ends{};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) std::abort();
    client_ = FileDescriptor(ends[0]);
    thread_ = std::thread([fd = ends[1], answer = std::move(answer)] { serve(FileDescriptor(fd), answer); });
  }
  ~FakePeer() {
    client_.close();
    thread_.join();
  }
  FakePeer(const FakePeer&) = delete;
  FakePeer& operator=(const FakePeer&) = delete;

  FileDescriptor client_end() { return std::move(client_); }

  static std::string framed(const v1::Envelope& envelope) {
    const std::string payload = envelope.SerializeAsString();
    std::string bytes;
    for (const std::byte b : frame_header(static_cast<std::uint32_t>(payload.size())))
      bytes += static_cast<char>(b);
    return bytes + payload;
  }

 private:
  static void serve(FileDescriptor socket, const Answer& answer) {
    FrameReader reader(kMaxRequestFrame);
    for (;;) {
      while (const auto payload = reader.next()) {
        v1::Envelope request;
        request.ParseFromArray(payload->data(), static_cast<int>(payload->size()));
        const std::string bytes = answer(request);
        if (bytes.empty()) return;
        if (::send(socket.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL) < 0) return;
      }
      const auto space = reader.free_space();
      const ssize_t got = ::recv(socket.get(), space.data(), space.size(), 0);
      if (got <= 0) return;
      reader.received(static_cast<std::size_t>(got));
    }
  }

  FileDescriptor client_;
  std::thread thread_;
};

}  // namespace drivebench::link
