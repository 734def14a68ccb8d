#include "protocols/can/codec.hpp"

#include <benchmark/benchmark.h>
#include <fmt/core.h>

#include <array>
#include <string>

#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::can_codec {
namespace {

constexpr double kMaxFrame_ns = 50.0;
constexpr int kFramesPerBatch = 20'000;
constexpr std::size_t kRounds = 20;

/// Numbers that take no shortcut.
Sample a_sample() {
  Sample sample;
  sample.tick = 123'456'789'012;
  sample.command_tick = 123'456'789'011;
  sample.command_age_ticks = 1;
  sample.missed_commands = 70'000;
  sample.state = 1;
  sample.encoder_count = -3'000'000'123;
  sample.encoder_levels = 35;
  sample.edge_age_s = 123.4e-6;
  sample.edge_period_s = 234.5e-6;
  sample.i_a_a = 1.23456;
  sample.i_b_a = -2.34567;
  sample.speed_rad_s = -62.83;
  sample.bus_voltage_v = 319.9;
  return sample;
}

template <class Work>
double batch_ns(Work work) {
  const std::int64_t begin = now_ns();
  for (int i = 0; i < kFramesPerBatch; ++i)
    work();
  return static_cast<double>(now_ns() - begin) / kFramesPerBatch;
}

struct Round {
  double encode_ns;
  double decode_ns;
};

Round one_round(const can::MessageRow& row) {
  can::Profile profile;
  profile.fd = row.variant != can::Variant::kClassic;
  profile.wide = row.width == can::Width::kWide;
  Sample sample = a_sample();
  can::Frame frame = can::encode_sample(row, profile, 1, sample);
  const double encode_ns = batch_ns([&] {
    ::benchmark::DoNotOptimize(sample);
    frame = can::encode_sample(row, profile, 1, sample);
    ::benchmark::DoNotOptimize(frame);
  });
  const double decode_ns = batch_ns([&] {
    ::benchmark::DoNotOptimize(frame);
    const can::Match found = can::match(profile, frame);
    can::Values values = can::decode(*found.row, profile, frame);
    ::benchmark::DoNotOptimize(values);
  });
  return {.encode_ns = encode_ns, .decode_ns = decode_ns};
}

}  // namespace

std::vector<Row> measure() {
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  Row encode{.name = "CAN frame, encoded", .unit = "ns", .limit = Limit{Limit::Kind::kAtMost, kMaxFrame_ns}};
  Row decode{.name = "CAN frame, recognised and decoded",
             .unit = "ns",
             .limit = Limit{Limit::Kind::kAtMost, kMaxFrame_ns}};
  const auto keep_slowest = [](Row& slowest, double measured_ns, const Disturbance& disturbance,
                               const can::MessageRow& row) {
    if (measured_ns <= slowest.measured) return;
    slowest.measured = measured_ns;
    slowest.disturbance = disturbance;
    slowest.note = fmt::format("the slowest message: {}, {} bytes", row.name, row.size);
  };
  for (const can::MessageRow& row : can::kMessages) {
    const auto rounds = undisturbed_rounds(cpu, kRounds, [&] { return one_round(row); });
    keep_slowest(encode, median(rounds.results, &Round::encode_ns), rounds.disturbance, row);
    keep_slowest(decode, median(rounds.results, &Round::decode_ns), rounds.disturbance, row);
  }
  return {encode, decode};
}

}  // namespace drivebench::speed::can_codec
