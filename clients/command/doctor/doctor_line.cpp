#include "clients/command/doctor/doctor_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/doctor/doctor.hpp"

namespace drivebench::command {

void add_doctor_command(CommandLine& line) {
  const auto [sub, o] = line.add<DoctorOptions>(
      "doctor", "tell what is wrong with this machine for real time and CAN, and how to mend it", run_doctor);
  begin_group(sub, kWhat);
  sub.add_option("--period-us", o.period_us,
                 "period of your bench [us]: a wake-up later than that would be a late tick")
      ->check(finite_between(1.0, 1e6))
      ->type_name("MICROSECONDS")
      ->capture_default_str();
  sub.add_option("--measure-s", o.measure_s, "how long wake-ups are measured; 0: not at all")
      ->check(finite_between(0.0, 3600.0))
      ->type_name("SECONDS")
      ->capture_default_str();
  sub.add_option("--root", o.root,
                 "read a copy of another machine's proc and sys in this folder; nothing is measured then")
      ->type_name("FOLDER")
      ->capture_default_str();
  sub.add_flag("--classic", o.classic, "classic CAN frames will do: no CAN FD is asked for");
  sub.footer(
      "Example:\n  drivebench doctor --period-us 125\n"
      "Exit codes: 0 no problems (notes are none), 1 problems, 2 usage.");
}

}  // namespace drivebench::command
