#pragma once

#include <bench.pb.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/web/gateway/drive/open_loop.hpp"
#include "clients/web/gateway/drive/orders.hpp"
#include "clients/web/gateway/drive/reference_run.hpp"

namespace drivebench::web {

/// Drives axes for a page, open loop or with a reference controller, in the page's own session and under its
/// leases, without the socket. The page orders targets, and the drive answers every sample with a command: a
/// timer of a browser is later than a watchdog allows. Real time: a command follows each answer. Lockstep:
/// time runs at a pace of the page's choice, or in steps.
///
/// A page that is silent for kSilence has gone: the drive ramps down, switches the gates off and gives the
/// leases back. A refused command switches the gates of all driven axes off, and the drive goes on so; where
/// that is refused too, it is over.
class Drive {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds kSilence{5};
  static constexpr std::chrono::seconds kRampDown{1};  ///< the longest ramp of a drive whose page has gone
  /// Requests of the drive have ids from here on; a page counts from 1.
  static constexpr std::uint64_t kFirstId = std::uint64_t{1} << 62;

  struct Turn {
    std::string bytes{};       ///< for the bench, now; empty: nothing
    Time again = Time::max();  ///< when to ask again, unless an order or an answer comes first
  };

  explicit Drive(const v1::Welcome& welcome);

  using Runs = std::vector<std::unique_ptr<ReferenceRun>>;

  /// What a text of the page asks. Throws OrderError.
  Order read(std::string_view text) const;
  /// The runs that the order begins: made_runs() makes them, before it is carried out.
  std::vector<Beginning> beginnings_of(const Order& order) const;
  const std::shared_ptr<const v1::BenchDescription>& bench() const noexcept { return bench_; }
  void carry_out(const Order& order, Runs begun, Time now);
  /// Tells the page a problem, such as that of an order.
  void tell(std::string problem);
  /// The page has gone.
  void leave(Time now);
  Turn next(Time now);
  /// Takes the payload of a frame of the bench; false: it answers no request of the drive.
  bool take(std::span<const std::byte> payload, Time now);
  /// What the page should know now, as JSON; empty: nothing new. Its state is `idle`, `drives`, `ends`, or
  /// `over`: the leases have gone back.
  std::string report(Time now);

  /// It commands nothing.
  bool is_over() const noexcept { return stage_ == Stage::kOver; }

 private:
  enum class Stage { kOver, kDriving, kRampingDown, kSwitchingOff, kReleasing };

  void set_targets(const Order& order, Runs begun, Time now);
  void switch_off_and_release(Time now);
  void move_on(Time now);
  void switch_off(const std::string& why);
  void taken(const v1::ExchangeReply& reply);
  void refused(const v1::Refusal& refusal);
  const char* state_word() const noexcept;
  bool is_off() const noexcept;
  bool has_arrived() const noexcept;
  v1::Command command(std::uint32_t axis);
  /// When the next tick may run.
  Time due(Time now) const noexcept;
  std::string exchange(Time now);
  std::string releases();
  void add_frame(std::string& bytes, v1::Envelope& envelope);

  double period_s_;
  bool is_lockstep_;
  std::shared_ptr<const v1::BenchDescription> bench_;
  std::vector<OpenLoop> axes_{};                       // of the bench
  std::vector<std::unique_ptr<ReferenceRun>> runs_{};  // in the place of the open loop of an axis
  std::vector<std::uint32_t> driven_{};
  Stage stage_ = Stage::kOver;
  Time heard_{};     // from the page
  Time deadline_{};  // of the stages that end the drive
  double pace_ = 1.0;
  std::uint64_t steps_ = 0;  // still to run while time stands still
  Time due_{};               // of the next tick in lockstep
  std::uint64_t tick_ = 0;
  bool knows_tick_ = false;
  bool is_waiting_ = false;  // for the answer of an exchange
  bool is_off_sent_ = false;
  std::uint64_t last_id_ = kFirstId;
  std::string problem_{};
  bool gave_back_ = false;  // the leases, since the last order to drive
  Time reported_{};
  bool has_news_ = false;
  bool is_asked_for_presets_ = false;
};

}  // namespace drivebench::web
