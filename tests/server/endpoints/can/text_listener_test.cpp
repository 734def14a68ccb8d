#include "server/endpoints/can/buses/text_listener.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <string>

#include "server/host/asio.hpp"

namespace drivebench::can::text_listener_test {
namespace {

// Catches: a log that grows by ten lines a second while no descriptors are left for new clients.
TEST(TextListener, ClientsThatCannotBeAcceptedDoNotFillTheLog) {
  asio::io_context io(1);
  TextListener listener(io);
  int accepted = 0;
  listener.on_client = [&accepted](int fd) {
    ++accepted;
    ::close(fd);
  };
  ASSERT_EQ(listener.open({.address = "127.0.0.1", .port = 0}), "");
  testing::internal::CaptureStderr();
  asio::ip::tcp::socket client(io);
  client.connect({asio::ip::make_address("127.0.0.1"), listener.port()});
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
  const int next = ::dup(0);
  ::close(next);
  const rlimit none{.rlim_cur = static_cast<rlim_t>(next), .rlim_max = limit.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  io.run_for(std::chrono::milliseconds(350));
  EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
  EXPECT_EQ(accepted, 0);
  while (accepted == 0)
    io.run_one();
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
  EXPECT_NE(text.find("cannot accept a CAN client"), std::string::npos) << text;
}

}  // namespace
}  // namespace drivebench::can::text_listener_test
