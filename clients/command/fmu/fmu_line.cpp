#include "clients/command/fmu/fmu_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/fmu/fmu.hpp"

namespace drivebench::command {

void add_fmu_command(CommandLine& line) {
  const auto [sub, o] = line.add<FmuOptions>(
      "fmu", "a bench as an FMU, for Simulink, OpenModelica, Dymola and others", run_fmu);
  sub.add_option("BENCH", o.bench, "a bench file, or the name of one that came with drivebench")
      ->capture_default_str();
  sub.add_option("--out", o.out_file, "default: the bench's name with .fmu, here")->type_name("FILE");
  sub.add_option("--fmi", o.fmi, "version of the standard")
      ->check(CLI::IsMember({2, 3}))
      ->capture_default_str();
  sub.footer("Example: drivebench fmu bm500 --out motor.fmu");
}

}  // namespace drivebench::command
