#pragma once

#include <cstdint>
#include <optional>

#include "server/endpoints/tcp/capture/capture.hpp"
#include "server/endpoints/tcp/sending/audience.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"

namespace drivebench {

/// The trigger of a session: at most one, armed by a request. It tells the client of each event, and gives
/// the samples around it in the pieces for which the client asks.
class ScopeTrigger final : public Audience::Watcher {
 public:
  explicit ScopeTrigger(Dialogue& dialogue) : dialogue_(dialogue) {}

  void set(const v1::Trigger& request);
  void read(const v1::ReadCapture& request);
  /// Gives up the trigger with its capture.
  void end();

  void on_tick() override;
  void on_set_back() override { capture_->begin_anew(); }

 private:
  static constexpr std::size_t kBytesPerPiece = std::size_t{64} * 1024;

  std::optional<CaptureSettings> read_settings(const v1::Trigger& request);
  bool read_event(const v1::Trigger& request, TriggerEvent& event);
  bool read_channels(const v1::Trigger& request, CaptureSettings& settings);
  bool fits(const CaptureSettings& settings);
  bool refuse(v1::RefusalCode code, const std::string& sentence, const char* field);

  Dialogue& dialogue_;
  std::optional<Capture> capture_;
  std::uint64_t number_ = 0;  // of the last capture of the triggers before
};

}  // namespace drivebench
