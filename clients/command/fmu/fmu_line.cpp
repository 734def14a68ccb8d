#include "clients/command/fmu/fmu_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/fmu/fmu.hpp"

namespace drivebench::command {

void add_fmu_command(CommandLine& line) {
  const auto [sub, o] = line.add<FmuOptions>(
      "fmu", "write a bench as an FMU, for Simulink, OpenModelica, Dymola and others", run_fmu);
  sub.add_option("BENCH", o.bench, "a bench file, or the name of one of configs/benches")
      ->type_name("BENCH")
      ->capture_default_str();
  begin_group(sub, kOutput);
  sub.add_option("--out", o.out_file, "write to this file; default: the bench's name with .fmu, here")
      ->type_name("FILE");
  sub.add_option("--fmi", o.fmi, "version of the standard")
      ->type_name("VERSION")
      ->check(CLI::IsMember({2, 3}))
      ->capture_default_str();
  sub.footer("Example:\n  drivebench fmu bm500 --out motor.fmu");
}

}  // namespace drivebench::command
