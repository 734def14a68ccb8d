#include "clients/command/datasheet/new_bench.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <iterator>
#include <numbers>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/datasheet/new_file.hpp"
#include "clients/command/motor/motor_file.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;

constexpr auto kLink =
    std::to_array<Form>({{"bus-v", "V", "of the DC supply or link", 1e-3, kMostGiven, as_it_is}});
constexpr auto kCurrent = std::to_array<Form>({
    {"max-current-a", "A peak", "of a terminal, above which the drive switches off", 1e-3, kMostGiven,
     as_it_is},
    {"max-current-rms", "A rms", "the same", 1e-3, kMostGiven,
     [](double x, const Sheet&) { return x * std::numbers::sqrt2; }, "{x} * sqrt(2)",
     "The trip compares instants, so it counts peaks."},
});
constexpr auto kEncoder = std::to_array<Form>({
    {"cpr", "counts/turn", "after quadrature, as the bench counts", 4, 1e8, as_it_is},
    {"lines", "lines/turn", "lines or pulses of one channel", 1, 2.5e7,
     [](double x, const Sheet&) { return 4.0 * x; }, "4 * {x}", "Each line has four edges of A and B."},
});
constexpr auto kQuantities = std::to_array<Quantity>({
    {"voltage_v", "voltage of the link", true, kLink},
    {"over_current_a", "largest current", true, kCurrent},
    {"counts_per_revolution", "encoder counts N", true, kEncoder},
});

constexpr std::array<std::string_view, 4> kKinds = {"pm_dc", "pm_synchronous", "bldc", "induction"};

/// The bridge has the whole link between two terminals, so a phase of a star has half of it against the
/// middle, and a winding of its own all of it.
std::string drive_text(const MotorFile& motor, Sheet& sheet) {
  const FileLine link = line_of(kQuantities[0], sheet);
  const double link_v = sheet.value("voltage_v");
  std::string text;
  if (motor.star) {
    text = fmt::format(
        "\n[axis.drive]\nkind = \"averaged_inverter\"   # switched_inverter resolves every edge\n"
        "\n[axis.bus]\n{}"
        "\n[axis.amplifier]\n"
        "# A star: a terminal has half of the link, {:g} / 2, against its middle; a sine reaches {:.4g} V "
        "peak\n"
        "# of a phase, {:.10g} / sqrt(3), and the power-invariant u_q sqrt(3/2) times that, {:.4g} V.\n"
        "voltage_limit_v = {}\n",
        text_of(link), link_v, link_v / std::numbers::sqrt3, link_v, link_v / std::numbers::sqrt2,
        real(link_v / 2.0));
  } else {
    text = fmt::format(
        "\n[axis.drive]\nkind = \"voltage_amplifier\"\n"
        "\n[axis.amplifier]\n# A bridge for each winding gives it the whole link with both signs: {:.10g}   "
        "[--bus-v, V]\n"
        "voltage_limit_v = {}\n",
        link_v, real(link_v));
  }
  return text + text_of(line_of(kQuantities[1], sheet)) + "over_current_trip = true\n\n[axis.encoder]\n" +
         text_of(line_of(kQuantities[2], sheet)) +
         (motor.kind == "bldc" ? "\n[axis.hall]\nenabled = true\n" : "");
}

std::string head_text(const NewBenchOptions& o, const MotorFile& motor) {
  const fs::path folder = o.out_file.empty() ? fs::path(".") : fs::path(o.out_file).parent_path();
  const fs::path from_here = fs::relative(motor.path, folder.empty() ? fs::path(".") : folder);
  const bool realtime = o.mode == "realtime";
  return fmt::format(
      "# A bench for {}.\n"
      "[bench]\n"
      "name = {}\n"
      "mode = \"{}\"\n"
      "period_us = {}   # of a tick: the controller's sample period\n"
      "# {}\n"
      "command_delay_ticks = {}\n"
      "\n[[axis]]\n"
      "name = \"motor\"\n"
      "motor = {}\n"
      "on_link_loss = \"freewheel\"\n",
      motor.name, in_quotes(motor.path.stem().string()), o.mode, real(o.period_us),
      realtime ? "Real time: command(k) holds from tick k + 1, as on a signal processor."
               : "Lockstep: time waits for the controller, and command(k) holds from tick k.",
      realtime ? 1 : 0, in_quotes(from_here.string()));
}

/// The server's own verdict on the file.
int check(const std::string& file) {
  using namespace std::chrono_literals;
  Process server({server_executable().string(), file, "--check-config"});
  if (const auto code = server.wait(Process::in(30s)); code != kExitOk)
    throw UsageError(
        fmt::format("{} is written, but the server does not accept it: see above", printable(file)));
  fmt::print(
      stderr,
      "{0} is written, and the server accepts it; run it: drivebench serve {0}, or open inproc:{0} in a "
      "program\n",
      file);
  return kExitOk;
}

}  // namespace

std::span<const Quantity> bench_quantities() {
  return kQuantities;
}

int run_new_bench(const NewBenchOptions& options) {
  check_new_file(options.out_file);
  const MotorFile motor = read_motor_file(options.motor);
  if (std::ranges::find(kKinds, motor.kind) == kKinds.end())
    throw UsageError(fmt::format("{}: machine.kind is {}, but new bench knows {}", motor.path.string(),
                                 printable(motor.kind), fmt::join(kKinds, ", ")));
  Sheet sheet = options.sheet;
  std::vector<Quantity> missing;
  std::ranges::copy_if(kQuantities, std::back_inserter(missing),
                       [&](const Quantity& q) { return !is_given(q, sheet); });
  complete(missing, sheet);
  const std::string drive = drive_text(motor, sheet);
  write_new_file(options.out_file, head_text(options, motor) + drive);
  return options.out_file.empty() ? kExitOk : check(options.out_file);
}

}  // namespace drivebench::command
