#include "drivers/lifeline.hpp"

#include <algorithm>
#include <exception>
#include <utility>

namespace previz {

using std::chrono::milliseconds;

Lifeline::Lifeline(std::string name, CameraOpener open, const LifelineOptions& options,
                   HostClock clock, LifelineHooks hooks)
    : name_(std::move(name)),
      open_(std::move(open)),
      options_(options),
      clock_(std::move(clock)),
      hooks_(std::move(hooks)),
      backoff_(options.backoff),
      counters_{{"opened", 0},   {"not opened", 0}, {"stalled", 0}, {"lost", 0},
                {"returned", 0}, {"back-offs", 0},  {"reset", 0}} {}

CameraFormat Lifeline::format() const {
  return format_;
}

void Lifeline::start() {
  if (wanted_) return;
  wanted_ = true;
  state_ = DeviceState::absent;
  backoff_.reset();
  last_refusal_.clear();
}

void Lifeline::stop() {
  wanted_ = false;
  close();
  state_ = DeviceState::absent;
}

CameraEvent Lifeline::next(milliseconds timeout) {
  if (!wanted_) return NoFrame{};
  const HostClock::Time deadline = clock_.now() + timeout;
  do {
    if (!camera_) {
      look_for_arrivals();
      clock_.sleep_until(std::min(backoff_.at(), deadline));
      if (!backoff_.due(clock_.now())) return NoFrame{};
      if (std::optional<CameraEvent> event = open()) return *std::move(event);
      continue;
    }
    const HostClock::Time until = std::min(deadline, next_deadline());
    const auto wait = std::chrono::ceil<milliseconds>(until - clock_.now());
    if (std::optional<CameraEvent> event = take(ask(std::max(wait, milliseconds(0)))))
      return *std::move(event);
    if (std::optional<CameraEvent> event = watch()) return *std::move(event);
  } while (clock_.now() < deadline);
  return NoFrame{};
}

// A driver that throws may do so at every call from then on: its device is opened anew.
CameraEvent Lifeline::ask(milliseconds timeout) {
  try {
    return camera_->next(timeout);
  } catch (const std::exception& error) {
    return DeviceTrouble{name_, std::string("has failed: ") + error.what(), true};
  }
}

std::optional<CameraEvent> Lifeline::open() {
  try {
    camera_ = open_();
    // One whose driver throws is forgotten, so that the next attempt is made without.
    const std::optional<Wanted> wanted = std::exchange(exposure_, std::nullopt);
    if (wanted) camera_->set_exposure(wanted->exposure_s, wanted->gain);
    exposure_ = wanted;
    camera_->start();
  } catch (const std::exception& error) {
    return not_opened(error.what());
  }
  ++counters_["opened"];
  if (counters_["lost"] > counters_["returned"]) ++counters_["returned"];
  last_refusal_.clear();
  format_ = camera_->format();
  sequence_offset_.reset();
  state_ = DeviceState::starting;
  since_ = clock_.now();
  std::string doubts;
  for (const std::string& doubt : camera_->doubts()) add_to_list(doubts, doubt, "; ");
  if (doubts.empty()) return std::nullopt;
  return DeviceTrouble{name_, doubts, false};
}

std::optional<CameraEvent> Lifeline::not_opened(const std::string& why) {
  camera_.reset();
  ++counters_["not opened"];
  state_ = DeviceState::absent;
  backoff_.failed(clock_.now());
  ++counters_["back-offs"];
  if (why == last_refusal_) return std::nullopt;
  last_refusal_ = why;
  return DeviceTrouble{name_, why + "; retrying until it is available"};
}

// Returns the event to pass on; nothing for NoFrame.
std::optional<CameraEvent> Lifeline::take(CameraEvent event) {
  if (auto* frame = std::get_if<FramePtr>(&event)) {
    state_ = DeviceState::streaming;
    since_ = clock_.now();
    backoff_.reset();
    return numbered(std::move(*frame));
  }
  if (auto* trouble = std::get_if<DeviceTrouble>(&event)) {
    if (trouble->lost) return lose(trouble->what);
    trouble->device = name_;
    return event;
  }
  if (std::holds_alternative<EndOfStream>(event)) {
    wanted_ = false;
    close();
    return event;
  }
  return std::nullopt;
}

// Renumbers frames, because a device that was opened again may count from its beginning.
FramePtr Lifeline::numbered(FramePtr frame) {
  if (!sequence_offset_)
    sequence_offset_ = frame->sequence < next_sequence_ ? next_sequence_ - frame->sequence : 0;
  next_sequence_ = frame->sequence + *sequence_offset_ + 1;
  if (*sequence_offset_ == 0) return frame;
  auto renumbered = std::make_shared<Frame>(*frame);
  renumbered->sequence += *sequence_offset_;
  return renumbered;
}

HostClock::Time Lifeline::next_deadline() const {
  switch (state_) {
    case DeviceState::starting:
      return since_ + options_.start_timeout;
    case DeviceState::streaming:
      return since_ + options_.stall_timeout;
    default:
      return since_ + options_.stall_timeout + options_.stall_patience;
  }
}

std::optional<CameraEvent> Lifeline::watch() {
  if (!camera_ || clock_.now() < next_deadline()) return std::nullopt;
  if (state_ == DeviceState::starting)
    return lose_silent("sends no frame within " + std::to_string(options_.start_timeout.count()) +
                       " ms of its start");
  if (state_ == DeviceState::streaming) {
    state_ = DeviceState::stalled;
    ++counters_["stalled"];
    return DeviceTrouble{
        name_, "has sent nothing for " + std::to_string(options_.stall_timeout.count()) + " ms"};
  }
  return lose_silent("is stalled");
}

CameraEvent Lifeline::lose(const std::string& why) {
  close();
  ++counters_["lost"];
  state_ = DeviceState::lost;
  backoff_.failed(clock_.now());
  ++counters_["back-offs"];
  return DeviceTrouble{name_, why + "; reopening it"};
}

// An unplugged device reports that itself; a device that is merely silent may be wedged, and is
// reset.
CameraEvent Lifeline::lose_silent(const std::string& why) {
  close();
  const std::optional<std::string> why_not = hooks_.reset ? hooks_.reset() : std::nullopt;
  if (!why_not) return lose(why);
  if (!why_not->empty()) return lose(why + "; it cannot be reset (" + *why_not + ")");
  ++counters_["reset"];
  return lose(why + "; it was reset");
}

// Any device that was plugged in may be this one. Its node may follow a little later, so attempts
// are as close together again as at first.
void Lifeline::look_for_arrivals() {
  const std::uint64_t arrivals = hooks_.arrivals ? hooks_.arrivals() : 0;
  if (std::exchange(arrivals_, arrivals) == arrivals) return;
  backoff_.reset();
}

void Lifeline::close() {
  if (!camera_) return;
  for (const auto& [what, count] : camera_->counters()) counters_[what] += count;
  camera_.reset();
}

bool Lifeline::set_exposure(double exposure_s, double gain) {
  exposure_ = {exposure_s, gain};
  return !camera_ || camera_->set_exposure(exposure_s, gain);
}

DeviceCounters Lifeline::counters() const {
  DeviceCounters all = counters_;
  if (camera_)
    for (const auto& [what, count] : camera_->counters()) all[what] += count;
  return all;
}

}  // namespace previz
