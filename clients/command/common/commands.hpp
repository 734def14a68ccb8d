#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/link/address.hpp"

/// The subcommands of `drivebench`: an options struct each and a function that gives the exit code. main.cpp
/// turns the command line into the former and exceptions into the latter.
namespace drivebench::command {

inline constexpr int kExitOk = 0;
inline constexpr int kExitFailed = 1;     ///< the run failed
inline constexpr int kExitUsage = 2;      ///< the command line or a configuration is wrong
inline constexpr int kExitNoConnect = 3;  ///< nothing answers, or it does not let us in
inline constexpr int kExitCutShort = 3;   ///< export: the recording ends early; what is there was written

/// The user can put it right: exit code 2.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What --link takes, for its help.
inline constexpr const char* kStreamLinks = "tcp:HOST:PORT, tls:HOST:PORT?ca=FILE or unix:PATH";

struct LinkChoice {
  std::string address{link::kDefaultAddress};
  std::string token;
};

struct DescribeOptions {
  LinkChoice link;
  bool json = false;
};
int run_describe(const DescribeOptions& options);

struct StatusOptions {
  LinkChoice link;
  bool json = false;
};
int run_status(const StatusOptions& options);

struct WatchOptions {
  LinkChoice link;
  bool json = false;
  std::string axis = "0";            ///< number or name
  std::vector<std::string> signals;  ///< empty: a choice of ours
  double rate_hz = 10.0;             ///< in the bench's time
  std::uint64_t count = 0;           ///< 0: until interrupted
};
int run_watch(const WatchOptions& options);

/// A fault to put into an axis; a value of 0 takes it away.
struct InjectOptions {
  LinkChoice link;
  bool json = false;
  std::string axis;  ///< number or name
  std::string fault;
  double value = 0.0;
};
int run_inject(const InjectOptions& options);

/// A parameter to write.
struct SetOptions {
  LinkChoice link;
  bool json = false;
  std::string axis;  ///< number or name
  std::string name;
  std::string value;    ///< a number, or a word of a choice
  double ramp_s = 0.0;  ///< in the bench's time; 0: a step
};
int run_set(const SetOptions& options);

/// A blow on the shaft.
struct BumpOptions {
  LinkChoice link;
  bool json = false;
  std::string axis;  ///< number or name
  double impulse_nms = 0.0;
};
int run_bump(const BumpOptions& options);

/// An axis that somebody holds and is to hold no longer.
struct TakeOptions {
  LinkChoice link;
  bool json = false;
  std::string axis = "0";  ///< number or name
  bool force = false;
  std::string reason;  ///< told to whoever held it, and kept in the server's audit log
};
int run_take(const TakeOptions& options);

/// A load torque at a time after the start of the trajectory.
struct LoadAt {
  double load_nm = 0.0;
  double after_s = 0.0;
};

struct ParameterSetting {
  std::string name;
  double value = 0.0;
};

struct ControlOptions {
  LinkChoice link;
  bool json = false;
  bool list = false;   ///< print the presets and end
  bool gains = false;  ///< print the gains of the preset, with --list of all, and end
  std::string preset = "book/8.2.2";
  std::vector<control::Gain> overrides;  ///< of its gains
  std::string axis = "0";                ///< number or name
  std::string csv_file;                  ///< empty: none
  std::vector<LoadAt> loads;
  std::vector<ParameterSetting> settings;
  bool clear_faults = false;
};
int run_control(const ControlOptions& options);

/// The preset's controller fed with what a recording says, without a bench.
struct CompareOptions {
  std::string recording{};
  bool json = false;
  std::string preset = "book/8.2.2";
  std::vector<control::Gain> overrides{};
  std::string axis{};                        ///< name; empty or "0": the first in the file
  std::optional<std::uint64_t> from_tick{};  ///< where the run starts; else where the first command counts
  std::string other{};                       ///< recording of the reference's own run; empty: none
  /// [V] or [A]; the exit code is 1 if a command differs by more or some of the run is missing.
  std::optional<double> threshold{};
};
int run_compare(const CompareOptions& options);

/// A controlled run of a recording as an SVG picture.
struct PlotOptions {
  std::string recording{};
  std::string out_file{};  ///< empty: standard output
  std::string preset{};    ///< whose trajectory is drawn beside it; empty: none
  std::vector<control::Gain> overrides{};
  std::string axis{};                        ///< name; empty: the first in the file
  std::optional<std::uint64_t> from_tick{};  ///< where the run starts; else where the first command counts
  std::vector<std::string> panels{};         ///< empty: a choice of ours
  std::string title{};                       ///< empty: the preset, or else the file
};
int run_plot(const PlotOptions& options);

/// This, run_replay() and run_print() replace this process by drivebench-server.
int run_serve(const std::vector<std::string>& arguments);

struct ReplayOptions {
  std::string recording;
  bool json = false;
};
int run_replay(const ReplayOptions& options);

/// What drivebench-server can print of a bench file.
struct PrintOptions {
  std::string config = "servo";  ///< path or name
  std::string what;              ///< "dbc", "can-table", "modbus-map" or "modbus-csv"
  unsigned bus = 1;              ///< which of its [[can]] sections
};
int run_print(const PrintOptions& options);

struct CanLogOptions {
  std::string address;
  std::string out_file;     ///< empty: standard output
  std::uint64_t count = 0;  ///< frames; 0: until interrupted
  double duration_s = 0.0;  ///< of wall time; 0: until interrupted
};
int run_can_log(const CanLogOptions& options);

struct ExportOptions {
  std::string recording{};
  bool json = false;
  std::string out_file{};              ///< empty: standard output
  std::string axis{};                  ///< name; empty: the first in the file
  std::vector<std::string> signals{};  ///< empty: all
  std::uint64_t from_tick = 0;
  std::uint64_t to_tick = std::numeric_limits<std::uint64_t>::max();
  std::string format = "csv";      ///< or "candump"
  std::string interface = "can0";  ///< candump: its name in every line
  unsigned node_base = 1;          ///< candump: node id of the first axis
  bool classic = false;            ///< candump: classic frames instead of FD
  std::string profile{};           ///< candump: keys as in a can: address
};
int run_export(const ExportOptions& options);

/// Experiments on the server; what each subcommand needs of it.
struct ExperimentOptions {
  LinkChoice link;
  bool json = false;
  std::string owner{};  ///< the secret; empty: that of this user, kept in a file
  std::string user{};   ///< a name that everybody sees
  std::string file{};   ///< run: what to do
  std::uint64_t id = 0;
  std::string
      out_file{};  ///< CSV, or the recording if it ends with .mcap; empty: fetch writes to standard output
  bool detach = false;       ///< run: do not wait for its end
  double patience_s = 30.0;  ///< so long a broken link may stay broken
};
int run_experiment_run(const ExperimentOptions& options);
int run_experiment_list(const ExperimentOptions& options);
int run_experiment_fetch(const ExperimentOptions& options);
int run_experiment_cancel(const ExperimentOptions& options);

/// A motor identified from an experiment on a bench, or from a file.
struct IdentifyOptions {
  ExperimentOptions server{};   ///< link, owner, user and patience count
  bool link_was_named = false;  ///< on the command line: no other bench will do
  bool json = false;
  bool list = false;  ///< print motors and experiments and end
  std::string motor{};
  std::string experiment{};  ///< name, or file; empty: the first of the motor
  std::string bench{};  ///< a server of our own on this bench, by path or name; empty: as the experiment says

  std::string from_file{};          ///< a recording (.mcap) or CSV in the place of an experiment
  std::vector<std::string> maps{};  ///< of CSV: HEADER=SIGNAL or a column-map file
  std::string time{};               ///< of CSV: header of the time; empty: time_s
  std::optional<double> period_s{};
  std::string axis{};  ///< of a recording: name; empty: the first in the file

  std::optional<int> pole_pairs{};
  std::optional<double> counts_per_revolution{};
  std::optional<int> phases{};
  std::string voltages{};  ///< mean or instant; empty: as the source of the data says
  std::optional<double> voltage_shift{};
  std::string window{};  ///< FROM:TO [s]
  std::optional<double> current_hz{};
  std::optional<double> voltage_hz{};
  std::optional<double> shaft_hz{};
  std::optional<int> order{};
  std::string load{};  ///< viscous or constant; empty: as the experiment says
  bool one_stage = false;

  std::string markdown_file{};
  std::string plot_file{};
  std::string motor_file{};
  std::string data_file{};  ///< CSV
};
int run_identify(const IdentifyOptions& options);

struct DemoOptions {
  bool json = false;
  std::string folder = "recordings";
};
int run_demo(const DemoOptions& options);

}  // namespace drivebench::command
