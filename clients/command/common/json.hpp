#pragma once

#include <bench.pb.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/command/control/control_compare.hpp"
#include "clients/command/control/control_run.hpp"
#include "clients/command/demo/demo_report.hpp"
#include "clients/command/experiment/experiment_file.hpp"
#include "clients/command/identify/identify_report.hpp"
#include "protocols/signals/catalogue.hpp"

/// All JSON that the command writes and reads, so that one file pays for the parser.
namespace drivebench::command {

std::string describe_json(const v1::Welcome& welcome);
std::string status_json(const v1::Status& status, const v1::BenchDescription& bench);
/// One line: axis, dropped and the chosen signals.
std::string sample_json(const Sample& sample, std::uint32_t axis, std::uint64_t dropped,
                        const std::vector<const Signal*>& signals);
/// A fault, parameter or bump that was taken, with its tick.
std::string change_json(std::uint32_t axis, std::string_view name, double value, std::uint64_t tick);
std::string presets_json();
std::string gains_json(const std::vector<control::Gain>& gains);
std::string comparison_json(const Comparison& comparison);
std::string control_json(const ControlReport& report);
std::string export_json(std::string_view out_file, std::string_view axis, std::uint64_t rows,
                        std::string_view problem);
/// `resumed`: how often a broken link was made anew.
std::string experiment_json(const v1::ExperimentInfo& info, std::string_view out_file, std::uint64_t resumed);
std::string experiments_json(const v1::ExperimentList& list);
/// What identification::to_json says, and experiment, settings and validation.
std::string identify_json(const IdentifyReport& report);
std::string named_experiments_json();
std::string demo_json(const DemoReport& report);
std::string error_json(std::string_view kind, std::string_view message, std::string_view field);

// Of a line of text; nothing if it is not what it should be.
std::optional<ServerReady> parse_ready(std::string_view line);
std::optional<ServerVerdict> parse_verdict(std::string_view line);
std::optional<ControlReport> parse_control(std::string_view line);
std::optional<DemoReplay> parse_replay(std::string_view line);

}  // namespace drivebench::command
