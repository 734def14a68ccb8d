#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "protocols/signals/catalogue.hpp"

namespace drivebench {

/// Upper bound of an encoded sample: two tag bytes and at most ten of value for each signal.
inline constexpr std::size_t kMaxSampleBytes = kSignals.size() * 12;

/// Encodes the signals of the mask as message drivebench.v1.Sample; like proto3 it leaves out zeros. Returns
/// the number of bytes, at most kMaxSampleBytes.
std::size_t encode_sample(const Sample& sample, SignalMask mask, std::byte* out) noexcept;

/// A sample with the axis it belongs to.
struct AxisSampleView {
  std::uint32_t axis;
  const Sample* sample;
};

/// Appends a frame (length and envelope) with an ExchangeReply to `out`.
void append_exchange_reply(std::vector<std::byte>& out, std::uint64_t id,
                           std::span<const AxisSampleView> samples);

/// Appends a frame with a Samples message to `out`.
void append_samples(std::vector<std::byte>& out, std::uint32_t axis, std::uint64_t dropped,
                    std::span<const Sample> samples, SignalMask mask);

/// Decodes a message Sample; nothing if the bytes are not one.
std::optional<Sample> decode_sample(std::span<const std::byte> bytes) noexcept;

}  // namespace drivebench
