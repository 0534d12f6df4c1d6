#include "daemon/core/output/record_queue.hpp"

#include <algorithm>
#include <limits>
#include <new>
#include <utility>

#include "drivers/bracket.hpp"

namespace previz::output {
namespace {

// A frame may be offered so long after its capture.
constexpr std::chrono::seconds capture_delay{1};

}  // namespace

void NewestLight::remember(const Captured& captured) {
  forget_unlike(*captured.frame);
  by_exposure_[exposure_step(captured.frame->exposure)] = captured;
  if (by_exposure_.size() <= most_exposures) return;
  by_exposure_.erase(std::ranges::min_element(
      by_exposure_, {}, [](const auto& older) { return older.second.frame->timestamp_ns; }));
}

void NewestLight::forget_unlike(const Frame& frame) {
  std::erase_if(by_exposure_, [&](const auto& older) {
    const Frame& known = *older.second.frame;
    return known.format != frame.format || known.bayer != frame.bayer ||
           known.width != frame.width || known.height != frame.height;
  });
}

std::vector<Captured> NewestLight::in_order() const {
  std::vector<Captured> lights;
  for (const auto& [step, light] : by_exposure_) lights.push_back(light);
  std::ranges::sort(lights, {}, [](const Captured& c) { return c.frame->timestamp_ns; });
  return lights;
}

void add(session::Losses& to, const session::Losses& more) {
  to.frames += more.frames;
  to.shown += more.shown;
  to.records += more.records;
}

// Returns about how much memory an entry takes. An entry that begins or ends a take counts as 0, so
// that it is never left out.
std::uint64_t RecordQueue::bytes_of(const Entry& entry) {
  if (const auto* captured = std::get_if<Captured>(&entry)) return captured->frame->bytes.size();
  if (const auto* event = std::get_if<Event>(&entry)) return sizeof(Entry) + event->what.size();
  if (const auto* button = std::get_if<ButtonEvent>(&entry))
    return sizeof(Entry) + button->button.size();
  if (const auto* mark = std::get_if<session::MarkEvent>(&entry))
    return sizeof(Entry) + mark->point.size();
  const auto* record = std::get_if<session::TrackRecord>(&entry);
  if (!record) return 0;
  constexpr std::uint64_t of_a_name = 128;  // of a node of a map and its key
  std::uint64_t bytes = sizeof(Entry) + record->tags.size() * sizeof(int);
  bytes += record->scene.objects.size() * (of_a_name + sizeof(glm::dmat4));
  bytes += record->scene.lights.size() * (of_a_name + sizeof(session::LightState));
  bytes += record->carriers.size() * (of_a_name + sizeof(session::CarrierState));
  if (const auto& light = record->captured_light)
    bytes += light->sources.size() * sizeof(session::CapturedSource) +
             light->ambient.size() * sizeof(glm::vec3);
  return bytes;
}

session::Losses RecordQueue::loss_of(const Entry& entry) {
  if (const auto* captured = std::get_if<Captured>(&entry)) {
    if (captured->frame->source == "composite") return {.shown = 1};
    return {.frames = 1};
  }
  return bytes_of(entry) > 0 ? session::Losses{.records = 1} : session::Losses{};
}

session::Losses RecordQueue::push_within(std::uint64_t room, Entry entry) {
  const std::uint64_t bytes = bytes_of(entry);
  if (bytes > 0 && queued_bytes_ + bytes > room) {
    const session::Losses loss = loss_of(entry);
    add(left_out_, loss);
    return loss;
  }
  const session::Losses loss = loss_of(entry);
  const auto* captured = std::get_if<Captured>(&entry);
  const bool is_observers = captured && captured->frame->source == "observer";
  const std::int64_t frame_ns = is_observers ? captured->frame->timestamp_ns : last_frame_ns_;
  try {
    queue_.push_back({std::move(entry), left_out_});
  } catch (const std::bad_alloc&) {
    if (loss == session::Losses{}) throw;
    add(left_out_, loss);
    return loss;
  }
  left_out_ = {};
  last_frame_ns_ = frame_ns;
  queued_bytes_ += bytes;
  return {};
}

LeftOut RecordQueue::push(const Captured& captured) {
  if (captured.frame->source == "light") remember_light(captured);
  newest_ = std::max(newest_, captured.offered);
  LeftOut left_out;
  while (is_behind(most_behind_s_)) leave_out(oldest_picture(), left_out);
  left_out.is_too_far_behind = left_out.any();
  add(left_out.of_newest, push_within(bytes_, captured));
  return left_out;
}

bool RecordQueue::is_behind(double bound_s) const {
  const Backlog backlog = backlog_with(newest_);
  return backlog.seconds - backlog.of_ring_s > bound_s;
}

// The entry after it says what was left out, or the next one if there is none.
void RecordQueue::leave_out(std::size_t place, LeftOut& left_out) {
  const auto at = queue_.begin() + static_cast<std::ptrdiff_t>(place), next = std::next(at);
  const bool is_older = std::any_of(next, queue_.end(), [](const Queued& queued) {
    return std::holds_alternative<Start>(queued.entry);
  });
  const session::Losses loss = loss_of(at->entry);
  add(is_older ? left_out.of_older : left_out.of_newest, loss);
  session::Losses& said_by_next = next == queue_.end() ? left_out_ : next->lost;
  add(said_by_next, loss);
  add(said_by_next, at->lost);
  queued_bytes_ -= bytes_of(at->entry);
  queue_.erase(at);
}

// The light from before the take may be of any age.
std::size_t RecordQueue::oldest_picture() const {
  const auto oldest = std::ranges::find_if(queue_, [this](const Queued& queued) {
    const auto* captured = std::get_if<Captured>(&queued.entry);
    return captured && (captured->frame->source != "light" || captured->offered > began_);
  });
  return static_cast<std::size_t>(oldest - queue_.begin());
}

Backlog RecordQueue::backlog() const {
  return backlog_with(newest_);
}

Backlog RecordQueue::backlog_with(SteadyClock::time_point newest) const {
  using Seconds = std::chrono::duration<double>;
  Backlog backlog{.bytes = queued_bytes_, .entries = queue_.size()};
  const std::size_t oldest = oldest_picture();
  if (oldest == queue_.size()) return backlog;
  const Seconds waits = newest - std::get<Captured>(queue_[oldest].entry).offered;
  backlog.seconds = std::max(0.0, waits.count());
  const double since_s = Seconds(newest - began_).count();
  backlog.of_ring_s = begun_with_s_ * std::clamp(1 - since_s / ring_grace_s, 0.0, 1.0);
  return backlog;
}

LeftOut RecordQueue::push_shown(const Captured& captured) {
  LeftOut left_out;
  left_out.is_too_far_behind = is_behind(most_behind_s_ / 2);
  if (left_out.is_too_far_behind) {
    left_out.of_newest = loss_of(captured);
    add(left_out_, left_out.of_newest);
  } else {
    left_out.of_newest = push_within(bytes_ / 2, captured);
  }
  return left_out;
}

// Frames fill the queue first, so that a disk that is a little too slow loses no tracking.
LeftOut RecordQueue::push_record(Entry entry) {
  return {push_within(bytes_ + bytes_ / 8, std::move(entry)), {}, false};
}

void RecordQueue::push_mark(Entry entry) {
  push_within(bytes_, std::move(entry));
}

bool RecordQueue::keep(const Captured& captured) {
  ring_.emplace_back(captured);
  ring_bytes_ += bytes_of(ring_.back());
  return trim_ring();
}

void RecordQueue::keep(const session::TrackRecord& record) {
  ring_.emplace_back(record);
  ring_bytes_ += bytes_of(ring_.back());
  while (ring_bytes_ > bytes_ / 2) forget_first_of_ring();
}

// Drops the ring's oldest entries, counting time from its newest frame. A full ring must fit the
// queue with room to spare. Returns whether frames were dropped only because it was full.
bool RecordQueue::trim_ring() {
  const std::int64_t newest = std::get<Captured>(ring_.back()).frame->timestamp_ns;
  const auto keep_ns = static_cast<std::int64_t>(preroll_s_ * 1e9);
  bool is_short = false;
  while (!ring_.empty()) {
    const auto* captured = std::get_if<Captured>(&ring_.front());
    const bool old = !captured || newest - captured->frame->timestamp_ns > keep_ns;
    if (!old && ring_bytes_ <= bytes_ / 2) break;
    is_short = is_short || !old;
    forget_first_of_ring();
  }
  return is_short;
}

std::vector<FramePtr> RecordQueue::newest_of_ring(double seconds) const {
  std::vector<FramePtr> newest;
  for (const Entry& entry : ring_)
    if (const auto* captured = std::get_if<Captured>(&entry)) newest.push_back(captured->frame);
  if (newest.empty()) return newest;
  const std::int64_t begin = newest.back()->timestamp_ns - static_cast<std::int64_t>(1e9 * seconds);
  std::erase_if(newest, [&](const FramePtr& frame) { return frame->timestamp_ns < begin; });
  return newest;
}

double RecordQueue::ring_length_s() const {
  std::optional<std::int64_t> first, last;
  for (const Entry& entry : ring_)
    if (const auto* captured = std::get_if<Captured>(&entry)) {
      last = captured->frame->timestamp_ns;
      if (!first) first = last;
    }
  return first ? 1e-9 * static_cast<double>(*last - *first) : 0;
}

void RecordQueue::forget_first_of_ring() {
  ring_bytes_ -= bytes_of(ring_.front());
  const auto* captured = std::get_if<Captured>(&ring_.front());
  if (captured && captured->frame->source == "light") remember_light(*captured);
  ring_.pop_front();
}

// Without memory a take begins without this light; the next frame of its exposure is remembered.
void RecordQueue::remember_light(const Captured& captured) {
  try {
    older_light_.remember(captured);
  } catch (const std::bad_alloc&) {
    return;
  }
}

// In standby, or while the camera is missing, nothing is offered, and the ring's entries become too
// old.
void RecordQueue::forget_what_is_long_ago() {
  const auto keep = std::chrono::duration<double>(preroll_s_) + capture_delay;
  const auto is_long_ago = [&](const Entry& entry) {
    const auto* captured = std::get_if<Captured>(&entry);
    return !captured || SteadyClock::now() - captured->offered > keep;
  };
  while (!ring_.empty() && is_long_ago(ring_.front())) forget_first_of_ring();
}

session::Losses RecordQueue::begin() {
  forget_what_is_long_ago();
  session::Losses lost;
  constexpr std::uint64_t always = std::numeric_limits<std::uint64_t>::max() / 2;
  const auto queue_always = [&](Entry entry) { add(lost, push_within(always, std::move(entry))); };
  const auto light_of = [](const Entry& entry) -> const Captured* {
    const auto* captured = std::get_if<Captured>(&entry);
    return captured && captured->frame->source == "light" ? captured : nullptr;
  };
  for (const Entry& entry : ring_)
    if (const Captured* light = light_of(entry)) older_light_.forget_unlike(*light->frame);
  const std::vector<Captured> lights = older_light_.in_order();
  push_mark(Start{});
  begun_with_s_ = ring_length_s();
  began_ = newest_ = SteadyClock::now();
  for (const Entry& entry : ring_)
    if (const auto* captured = std::get_if<Captured>(&entry)) began_ = newest_ = captured->offered;
  for (const Captured& light : lights) queue_always(light);
  for (Entry& entry : ring_) {
    if (const Captured* light = light_of(entry)) remember_light(*light);
    queue_always(std::move(entry));
  }
  ring_.clear();
  ring_bytes_ = 0;
  return lost;
}

bool RecordQueue::begins_a_take() const {
  return !queue_.empty() && std::holds_alternative<Start>(queue_.front().entry);
}

RecordQueue::Queued RecordQueue::pop() {
  Queued next = std::move(queue_.front());
  queue_.pop_front();
  queued_bytes_ -= bytes_of(next.entry);
  return next;
}

session::Losses RecordQueue::take_left_out() {
  return std::exchange(left_out_, {});
}

}  // namespace previz::output
