// The parts of subcommands that need no bench. The wire tests try the rest against the real server.
#include "clients/command/common/session/session.hpp"

#include <gtest/gtest.h>

#include "clients/command/bench/describe.hpp"
#include "clients/command/bench/status.hpp"
#include "clients/command/bench/watch.hpp"
#include "clients/command/can/can_log.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/experiment/experiment.hpp"
#include "clients/command/identify/identify.hpp"

namespace drivebench::command::session_test {
namespace {

// Catches: a link of another kind that is taken for the name of a host.
TEST(Links, OnlyControlGoesOverCanAndModbus) {
  for (const char* address : {"can:socketcan:vcan0", "modbus:127.0.0.1:1"}) {
    EXPECT_THROW(run_status({.link = {.address = address, .token = {}}}), UsageError);
    EXPECT_THROW(run_describe({.link = {.address = address, .token = {}}}), UsageError);
    EXPECT_THROW(run_watch({.link = {.address = address, .token = {}}, .signals = {}}), UsageError);
    EXPECT_THROW(open_axis({.address = address, .token = {}}, "1", "control"), UsageError);
    const ExperimentOptions experiment = {.server = {.link = {.address = address, .token = {}}, .owner = "o"},
                                          .id = 1};
    EXPECT_THROW(run_experiment_list(experiment), UsageError);
    EXPECT_THROW(run_experiment_fetch(experiment), UsageError);
    EXPECT_THROW(run_experiment_cancel(experiment), UsageError);
    EXPECT_THROW(run_identify({.server = experiment.server, .link_was_named = true, .motor = "im"}),
                 UsageError);
  }
  EXPECT_THROW(run_can_log({.address = "tcp:127.0.0.1:7300", .out_file = {}}), UsageError);
}

// Catches: a latched fault that is overlooked, or one that is not latched taken for it.
TEST(Links, LatchedFaultsAreKnownWithOrWithoutADescription) {
  v1::BenchDescription bench;
  EXPECT_EQ(latched_text(bench, {.state = 1, .faults = 2}), "");
  EXPECT_EQ(latched_text(bench, {.state = 4, .faults = 0x102}), "fault, fault word 0x102");
  v1::FaultDescription& fault = *bench.add_faults();
  fault.set_bit(2);
  fault.set_name("trip");
  fault.set_latched(true);
  EXPECT_EQ(latched_text(bench, {.state = 4, .faults = 3}), "trip");
  EXPECT_EQ(latched_text(bench, {.state = 4, .faults = 1}), "");
}

}  // namespace
}  // namespace drivebench::command::session_test
