#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "protocols/can/formats/kernel_frame.hpp"

namespace drivebench::can::can_kernel_frame_test {
namespace {

// Catches: a flag or a byte of a frame that is lost in the kernel's form of it.
TEST(CanKernelFrame, EveryKindComesBackAsItWas) {
  Frame frame{.id = 0x123, .size = 3, .data = {1, 2, 3}};
  EXPECT_EQ(frame_of(raw_of(frame), false), frame);
  frame.extended = true;
  frame.id = 0x1ABCDEF0;
  EXPECT_EQ(frame_of(raw_of(frame), false), frame);
  frame.fd = frame.bit_rate_switch = frame.error_state = true;
  frame.size = 64;
  frame.data.fill(0x5A);
  EXPECT_EQ(frame_of(raw_of(frame), true), frame);
  const Frame remote{.id = 0x7FF, .remote = true, .size = 8};
  EXPECT_EQ(frame_of(raw_of(remote), false), remote);
}

// Catches: an error frame that looks like a message with a small identifier.
TEST(CanKernelFrame, AnErrorFrameKeepsItsClassAndIsNoMessage) {
  canfd_frame raw{};
  raw.can_id = CAN_ERR_FLAG | 0x40;
  raw.len = 8;
  const Frame frame = frame_of(raw, false);
  EXPECT_TRUE(frame.error);
  EXPECT_FALSE(frame.extended || frame.remote);
  EXPECT_EQ(frame.id, 0x40u);
}

// Catches: a filter that lets a foreign frame in or keeps one of ours out, and one filter for each of many
// neighbouring identifiers.
TEST(CanKernelFrame, TheFiltersTakeExactlyTheIdentifiers) {
  std::vector<std::uint32_t> ids{0x300};
  for (std::uint32_t id = 0x180; id < 0x1A0; ++id)
    ids.push_back(id);
  ids.push_back(0x185);
  const std::vector<can_filter> filters = filters_for(ids);
  EXPECT_EQ(filters.size(), 2u);
  for (std::uint32_t id = 0; id <= kMaxStandardId; ++id) {
    const bool taken = std::any_of(filters.begin(), filters.end(), [id](const can_filter& filter) {
      return (id & filter.can_mask) == (filter.can_id & filter.can_mask);
    });
    EXPECT_EQ(taken, std::find(ids.begin(), ids.end(), id) != ids.end()) << id;
  }
}

}  // namespace
}  // namespace drivebench::can::can_kernel_frame_test
