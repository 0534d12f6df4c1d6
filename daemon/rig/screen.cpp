#include "daemon/rig/screen.hpp"

#include <algorithm>
#include <chrono>
#include <deque>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/core/output/guide_painter.hpp"
#include "daemon/core/output/osd_painter.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/display_drivers.hpp"
#include "drivers/display_lifeline.hpp"
#include "drivers/error.hpp"
#include "drivers/host_clock.hpp"

namespace previz::rig {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds words_interval{
    100};  // how often the words are checked while no picture comes
constexpr std::chrono::seconds file_interval{1};

struct Picture {
  std::shared_ptr<const Plate> plate;
  CardPicturePtr on_card;  // in place of the plate
  PictureFacts facts;
  Clock::time_point arrived;  // arrival at the daemon
  double in_device_s = 0;     // from capture to arrival, as the driver reports it
  bool frozen = false;        // a refinement's picture, which has no latency
  GuidesOf guides = {};

  // Either is 0 if there is no picture.
  int width() const { return on_card ? on_card->memory->width : plate ? plate->width : 0; }
  int height() const { return on_card ? on_card->memory->height : plate ? plate->height : 0; }

  double latency_s(std::int64_t shown_ns) const {
    const auto arrived_ns = std::chrono::nanoseconds(arrived.time_since_epoch()).count();
    return in_device_s + 1e-9 * static_cast<double>(shown_ns - arrived_ns);
  }
};

// Measures rate and median latency over the last second, or over the last two pictures. The figures
// change twice a second: nobody can read figures that change with every picture.
class PaceMeter {
 public:
  void shown(std::int64_t now_ns, double latency_s) {
    shown_.push_back({now_ns, latency_s});
    while (shown_.size() > 2 && now_ns - shown_.front().at_ns > second_ns) shown_.pop_front();
    if (now_ns - read_off_ns_ < second_ns / 2) return;
    read_off_ns_ = now_ns;
    std::vector<double> latencies;
    for (const Entry& entry : shown_) latencies.push_back(entry.latency_s);
    const double span_s = 1e-9 * static_cast<double>(now_ns - shown_.front().at_ns);
    pace_ = {span_s > 0 ? static_cast<double>(shown_.size() - 1) / span_s : 0,
             pipeline::quantile(std::move(latencies), 0.5)};
  }
  const Pace& read() const { return pace_; }

 private:
  static constexpr std::int64_t second_ns = 1'000'000'000;
  struct Entry {
    std::int64_t at_ns;
    double latency_s;
  };
  std::deque<Entry> shown_;
  std::int64_t read_off_ns_ = 0;
  Pace pace_;
};

DisplayOpener opener_of(const set::Set& set) {
  const set::Display& display = set.display;
  const DisplaySettings settings{display.connector, display.mode, display.scale};
  try {
    const DisplayDriver& driver = display_driver(display.driver);
    return [&driver, settings] { return driver.open(settings); };
  } catch (const Error& error) {
    throw Error(set.file.string() + ": display.driver: " + error.what());
  }
}

}  // namespace

struct Screen::Impl {
  Impl(const set::Set& set, Parts the_parts);
  ~Impl() {
    pictures.close();
    thread.join();
  }

  void run();
  void look_after(std::optional<Picture>& newest);
  void begin_anew();
  bool renew_guides(bool fresh, const live::Look& look);
  void put(const output::OsdPage& next, bool fresh);
  Screenful compose(const DisplayMode& mode, const output::OsdPage& next);
  void was_shown(const Shown& shown, bool fresh);
  void read_back();

  const set::Display settings;
  const Parts parts;
  pipeline::Mailbox<Picture> pictures;
  pipeline::Newest<RigFacts> rig{{}};
  pipeline::Newest<std::optional<CardIdentity>> card{std::nullopt};

  // Only the thread uses these.
  DisplayLifeline life;
  std::optional<output::OsdPainter> painter;
  std::optional<output::GuidePainter> guide_painter;
  DisplayMode painted_for;
  output::OsdPage painted;
  std::vector<Overlay> overlays;  // `painted`, for `painted_for`
  std::optional<Picture> picture;
  std::shared_ptr<const output::GuidePage> guides;  // over `picture`; null: none
  // What of a look says which lines are wanted.
  struct Asked {
    bool guides = false;
    live::Marking marking;
    live::Mode mode = live::Mode::standby;

    bool any() const { return guides || marking.is_on; }
    friend bool operator==(const Asked&, const Asked&) = default;
  };
  Asked asked_for;  // when `guides` were made
  PaceMeter pace;
  output::OsdPage page;
  bool up_to_date = false;  // the screen shows `picture` and `page`
  bool dark = false;
  Clock::time_point written;
  pipeline::StageKeeper keeper{"screen", parts.kept, &pipeline::Patience::stage,
                               [this] { begin_anew(); }};
  std::jthread thread;
};

Screen::Impl::Impl(const set::Set& set, Parts the_parts)
    : settings(set.display),
      parts(std::move(the_parts)),
      life(set.display.connector.empty() ? "display" : "display " + set.display.connector,
           opener_of(set)) {
  const output::Font is_there(output::default_font(), 1);  // throws here rather than on the thread
  thread = std::jthread([this] { run(); });
}

void Screen::Impl::run() {
  pipeline::Intake intake(parts.kept.metrics, "screen", pictures);
  while (!pictures.finished()) {
    std::optional<Picture> newest = pictures.pop_for(words_interval);
    const bool has_picture = newest.has_value();
    if (!keeper.attempt([&] { look_after(newest); }) && has_picture)
      parts.kept.metrics.dropped("screen", "failed");
    intake.update();
  }
  life.close();
}

void Screen::Impl::begin_anew() {
  life.close();
  painter.reset();
  guide_painter.reset();
  overlays.clear();
  up_to_date = dark = false;
}

void Screen::Impl::look_after(std::optional<Picture>& newest) {
  const std::shared_ptr<const RigFacts> facts = rig.get();
  const bool fresh = newest.has_value();
  if (fresh) picture = std::move(newest);
  if (facts->look.state.mode == live::Mode::standby) {
    if (fresh) parts.kept.metrics.dropped("screen", "standby");
    if (!std::exchange(dark, true)) {
      life.release();
      parts.kept.metrics.count("screen: released");
    }
    up_to_date = false;
    return;
  }
  dark = false;
  output::OsdPage next;
  if (facts->look.osd) next = osd_page(*facts, picture ? &picture->facts : nullptr, pace.read());
  const bool other_guides = renew_guides(fresh, facts->look);
  if (fresh || !up_to_date || other_guides || next != page) put(next, fresh);
}

// Returns whether the screen has other lines to show. Those of a picture that stands may come late:
// when they are asked for, or once the model is there.
bool Screen::Impl::renew_guides(bool fresh, const live::Look& look) {
  Asked asked{look.guides, look.marking, look.state.mode};
  const bool is_same = asked == asked_for;
  if (!fresh && is_same && (!asked.any() || (guides && guides->is_whole))) return false;
  asked_for = std::move(asked);
  std::shared_ptr<const output::GuidePage> next =
      asked_for.any() && picture && picture->guides ? picture->guides(look) : nullptr;
  const bool shows_same = next && guides ? *next == *guides : next == guides;
  guides = std::move(next);
  return !shows_same;
}

void Screen::Impl::put(const output::OsdPage& next, bool fresh) {
  const auto begin = Clock::now();
  const std::optional<DisplayEvent> event =
      life.show([&](const DisplayMode& mode) { return compose(mode, next); });
  const Display* display = life.display();
  card.set(display ? display->card() : std::nullopt);
  up_to_date = event && std::holds_alternative<Shown>(*event);
  if (up_to_date) {
    page = next;
    was_shown(std::get<Shown>(*event), fresh);
    if (fresh)
      parts.kept.metrics.worked("screen",
                                std::chrono::duration<double>(Clock::now() - begin).count());
    return;
  }
  if (fresh) parts.kept.metrics.dropped("screen", "no display");
  if (!event) return;
  const DeviceTrouble& trouble = std::get<DeviceTrouble>(*event);
  parts.kept.metrics.count("screen: device trouble");
  parts.kept.reports(report::counted({report::Severity::error, trouble.device, trouble.what}));
}

Screenful Screen::Impl::compose(const DisplayMode& mode, const output::OsdPage& next) {
  const bool other_screen = !painter || mode != painted_for;
  if (other_screen) {
    painter.emplace(mode.width, mode.height, settings.text_height);
    guide_painter.emplace(mode.width, mode.height, settings.scale);
  }
  if (other_screen || next != painted) overlays = painter->paint(next);
  painted_for = mode;
  painted = next;
  if (!picture) return {nullptr, overlays};
  std::vector<Overlay> all;
  if (guides && picture->width() > 0)
    all = guide_painter->paint(*guides, picture->width(), picture->height());
  all.insert(all.end(), overlays.begin(), overlays.end());
  return {picture->plate, std::move(all), picture->on_card};
}

void Screen::Impl::was_shown(const Shown& shown, bool fresh) {
  if (fresh && !picture->frozen) {
    const double latency_s = picture->latency_s(shown.timestamp_ns);
    parts.kept.metrics.shown(latency_s);
    pace.shown(shown.timestamp_ns, latency_s);
  }
  read_back();
}

void Screen::Impl::read_back() {
  if (parts.on_screen) parts.on_screen(life.display()->read_back(), page);
  if (drives_connectors(settings.driver) || Clock::now() - written < file_interval) return;
  written = Clock::now();
  try {
    output::write_png(parts.directory / "screen.png", life.display()->read_back());
  } catch (const std::exception& error) {
    parts.kept.reports(report::once({report::Severity::error, "", error.what()}));
  }
}

Screen::Screen(const set::Set& set, Parts parts)
    : metrics_(parts.kept.metrics),
      impl_(set.display.driver == set::no_driver ? nullptr
                                                 : std::make_unique<Impl>(set, std::move(parts))) {}

Screen::~Screen() = default;

void Screen::show(const pipeline::Shot& shot, GuidesOf guides) {
  Picture shown{shot.picture,
                shot.on_card,
                facts_of(shot),
                shot.arrived,
                1e-9 * static_cast<double>(shot.frame->arrival_ns - shot.frame->timestamp_ns),
                shot.frozen,
                std::move(guides)};
  if (impl_)
    impl_->pictures.push(std::move(shown));
  else if (!shown.frozen)
    metrics_.shown(shown.latency_s(monotonic_ns()));
}

void Screen::show(RigFacts facts) {
  if (impl_) impl_->rig.set(std::move(facts));
}

std::optional<CardIdentity> Screen::card() const {
  return impl_ ? *impl_->card.get() : std::nullopt;
}

}  // namespace previz::rig
