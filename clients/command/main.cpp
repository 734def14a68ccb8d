#include "clients/command/bench/bench_line.hpp"
#include "clients/command/can/can_line.hpp"
#include "clients/command/common/line/command_line.hpp"
#include "clients/command/control/control_line.hpp"
#include "clients/command/convert/convert_line.hpp"
#include "clients/command/datasheet/datasheet_line.hpp"
#include "clients/command/demo/demo_line.hpp"
#include "clients/command/doctor/doctor_line.hpp"
#include "clients/command/experiment/experiment_line.hpp"
#include "clients/command/fmu/fmu_line.hpp"
#include "clients/command/identify/identify_line.hpp"
#include "clients/command/motor/motor_line.hpp"
#include "clients/command/recording/recording_line.hpp"
#include "clients/command/regression/test_line.hpp"
#include "clients/command/web/web_line.hpp"

int main(int argc, char** argv) {
  using namespace drivebench::command;
  CommandLine line;
  add_demo_command(line);
  add_bench_commands(line);
  add_control_commands(line);
  add_experiment_commands(line);
  add_identify_commands(line);
  add_recording_commands(line);
  add_motor_commands(line);
  add_convert_commands(line);
  add_datasheet_commands(line);
  add_can_commands(line);
  add_fmu_command(line);
  add_doctor_command(line);
  add_regression_commands(line);
  add_web_command(line);
  return line.run(argc, argv);
}
