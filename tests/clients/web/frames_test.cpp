#include "clients/web/gateway/relays/frames.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocols/framing.hpp"

namespace drivebench::web::frames_test {
namespace {

std::string problem_of(const std::vector<int>& bytes) {
  std::vector<std::byte> message;
  for (const int each : bytes)
    message.push_back(static_cast<std::byte>(each));
  return std::string(problem_of_frames(message));
}

// Catches: bytes that would shift the stream to the bench, so that one browser's mistake looks like the
// gateway's.
TEST(Frames, WEB_03_OnlyWholeFramesPass) {
  EXPECT_EQ(problem_of({0, 0, 0, 1, 7}), "");
  EXPECT_EQ(problem_of({0, 0, 0, 1, 7, 0, 0, 0, 2, 8, 9}), "");
  EXPECT_EQ(problem_of({}), "a message holds at least one frame");
  EXPECT_EQ(problem_of({0, 0, 0}), "the message ends in the length of a frame");
  EXPECT_EQ(problem_of({0, 0, 0, 0}), "a frame is empty");
  EXPECT_EQ(problem_of({0, 0, 0, 2, 7}), "the message ends in a frame");
  EXPECT_EQ(problem_of({0, 0, 0, 1, 7, 9}), "the message ends in the length of a frame");
  EXPECT_EQ(problem_of({255, 255, 255, 255, 7}), "a frame is longer than a request may be");
}

// Catches: a limit that is one off.
TEST(Frames, WEB_03_AFrameMayBeAsLongAsARequest) {
  for (const std::size_t size : {kMaxRequestFrame, kMaxRequestFrame + 1}) {
    std::vector<std::byte> message(kFrameHeaderSize + size);
    const auto header = frame_header(static_cast<std::uint32_t>(size));
    std::copy(header.begin(), header.end(), message.begin());
    EXPECT_EQ(problem_of_frames(message).empty(), size == kMaxRequestFrame);
  }
}

}  // namespace
}  // namespace drivebench::web::frames_test
