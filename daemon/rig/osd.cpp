#include "daemon/rig/osd.hpp"

#include <fmt/format.h>

#include <cmath>

#include "daemon/core/set/names.hpp"
#include "daemon/core/set/problems.hpp"

namespace previz::rig {
namespace {

using output::OsdPage;
using output::OsdText;
using output::OsdTone;
using tracking::TrackStatus;

constexpr std::uint64_t little_space = 10'000'000'000;  // bytes, besides the reserve
constexpr double long_silence_s = 2;                    // of a disk
constexpr double long_behind_s = 1;                     // of a recording
constexpr std::size_t most_passes = 7;                  // that have a line of their own

// "1 tag", "2 tags"
std::string counted(int number, const char* noun) {
  return fmt::format("{} {}{}", number, noun, number == 1 ? "" : "s");
}

// 00:04:31
std::string clock(double seconds) {
  const auto whole = static_cast<long>(seconds);
  return fmt::format("{:02}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

OsdText mode(const live::Look& look) {
  switch (look.state.mode) {
    case live::Mode::live:
      return {"LIVE", OsdTone::plain};
    case live::Mode::refine:
      return {"REFINE", OsdTone::mode};
    case live::Mode::review:
      return {"REVIEW", OsdTone::mode};
    case live::Mode::standby:
      return {"STANDBY", OsdTone::mode};
  }
  return {};
}

OsdTone tone_of(report::Severity severity) {
  switch (severity) {
    case report::Severity::info:
      return OsdTone::plain;
    case report::Severity::warning:
      return OsdTone::warning;
    case report::Severity::error:
      return OsdTone::alarm;
  }
  return OsdTone::alarm;
}

OsdText space(std::uint64_t bytes) {
  const double gigabytes = 1e-9 * static_cast<double>(bytes);
  return {fmt::format("{:.{}f} GB free", gigabytes, gigabytes < 100 ? 1 : 0),
          bytes == 0             ? OsdTone::alarm
          : bytes < little_space ? OsdTone::warning
                                 : OsdTone::plain};
}

std::string samples(const PictureFacts& picture, const live::Look& look) {
  if (picture.samples == 0) return "plate only";
  std::string text = counted(picture.samples, "sample");
  if (look.state.mode == live::Mode::refine && picture.error > 0)
    text += fmt::format(" · error {:.2g} %", 100 * picture.error);
  if (picture.history > 0) text += " + " + counted(picture.history, "frame");
  if (picture.width > 0) text += fmt::format(" · {}x{}", picture.width, picture.height);
  return text;
}

OsdText tracking_words(const PictureFacts& picture) {
  if (picture.held_s > 0)
    return {fmt::format("predicted pose {:.1f} s", picture.held_s), OsdTone::warning};
  switch (picture.tracking) {
    case TrackStatus::lost:
      return {"tracking lost", OsdTone::alarm};
    case TrackStatus::ambiguous:
      return {"tracking ambiguous", OsdTone::alarm};
    case TrackStatus::tracked:
      break;
  }
  std::string text = counted(picture.tags, "tag");
  if (picture.deviation_mm > 0) text += fmt::format(" · ±{:.2g} mm", picture.deviation_mm);
  return {text, picture.tracking_trouble.empty() ? OsdTone::plain : OsdTone::warning};
}

OsdTone tone_of(const fit::Figure& figure) {
  if (!figure.things_off.empty() || fit::off_px(figure) > fit::most_off_px) return OsdTone::alarm;
  return OsdTone::plain;
}

void add_notices(const RigFacts& rig, const PictureFacts* picture, OsdPage& page) {
  for (const report::Notice& trouble : rig.troubles)
    page.notices.push_back({line_of(trouble), tone_of(trouble.severity)});
  if (rig.look.state.camera_lost && rig.troubles.empty())
    page.notices.push_back({"film camera: no picture", OsdTone::alarm});
  if (!rig.recorder_fault.empty())
    page.notices.push_back({"recording ended: " + rig.recorder_fault, OsdTone::alarm});
  if (rig.disk_silent_s >= long_silence_s)
    page.notices.push_back(
        {fmt::format("disk not responding for {:.0f} s", rig.disk_silent_s), OsdTone::alarm});
  else if (rig.backlog.seconds - rig.backlog.of_ring_s >= long_behind_s)
    page.notices.push_back({fmt::format("recording is {:.1f} s behind ({:.0f} MB in memory)",
                                        rig.backlog.seconds, 1e-6 * double(rig.backlog.bytes)),
                            OsdTone::warning});
  for (const std::string& lost : session::words_of(rig.lost))
    page.notices.push_back({"missing from the take: " + lost, OsdTone::alarm});
  if (!picture && !rig.look.state.camera_lost)
    page.notices.push_back({"waiting for the film camera", OsdTone::warning});
  if (picture && !picture->untouched.empty())
    page.notices.push_back({"plate only: " + picture->untouched, OsdTone::warning});
  else if (picture && !picture->tracking_trouble.empty())
    page.notices.push_back({"tracking: " + picture->tracking_trouble, OsdTone::warning});
  if (rig.fit && (!rig.fit->off || tone_of(*rig.fit) == OsdTone::alarm))
    page.notices.push_back({words_of(*rig.fit), tone_of(*rig.fit)});
  for (const report::Notice& news : rig.news)
    page.notices.push_back({line_of(news), tone_of(news.severity)});
}

std::string pixels(double px) {
  return fmt::format("{:.{}f} px", px, px < 9.95 ? 1 : 0);
}

std::string words_of(const std::vector<fit::PartOff>& things) {
  std::string text = fmt::format("\"{}\" off by {}: moved, or misplaced in the model",
                                 set::printable(things[0].name), pixels(things[0].shift_px));
  if (things.size() > 1)
    text += "; " + counted(static_cast<int>(things.size() - 1), "other thing") + " off";
  return text;
}

// Two digits of what takes little, and one of what takes long.
std::string milliseconds(double ms) {
  return fmt::format("{:.{}f} ms", ms, ms < 9.995 ? 2 : 1);
}

std::vector<OsdText> lines_of(const live::PassTimes& times) {
  const std::vector<live::PassTimes::Pass>& passes = times.passes;
  const char* const each = times.is_of_rounds ? "round" : "frame";
  double sum_ms = 0, others_ms = 0;
  std::vector<OsdText> longest;
  for (const live::PassTimes::Pass& pass : passes) {
    sum_ms += pass.ms;
    if (longest.size() < most_passes)
      longest.push_back({pass.name + ": " + milliseconds(pass.ms)});
    else
      others_ms += pass.ms;
  }
  std::vector<OsdText> lines = {{"graphics card: " + milliseconds(sum_ms) + " per " + each},
                                {"computer waits: " + milliseconds(times.waited_ms)}};
  lines.insert(lines.end(), longest.begin(), longest.end());
  if (passes.size() > most_passes)
    lines.push_back({counted(static_cast<int>(passes.size() - most_passes), "other") + ": " +
                     milliseconds(others_ms)});
  if (times.untimed > 0)
    lines.push_back(
        {fmt::format("{:.0f} passes per {} could not be timed", std::ceil(times.untimed), each),
         OsdTone::warning});
  return lines;
}

std::vector<OsdText> pass_times(const RigFacts& rig) {
  if (!rig.look.pass_times) return {};
  if (!rig.pass_times) return {{"graphics card: no frame timed yet"}};
  if (rig.pass_times->is_timed) return lines_of(*rig.pass_times);
  return {{(rig.device.empty() ? "this computer" : rig.device) + " does not time its passes"}};
}

}  // namespace

PictureFacts facts_of(const pipeline::Shot& shot) {
  PictureFacts facts;
  facts.samples = shot.samples;
  facts.history = shot.history;
  if (shot.picture) {
    facts.width = shot.picture->width;
    facts.height = shot.picture->height;
  } else if (shot.on_card) {
    facts.width = shot.on_card->memory->width;
    facts.height = shot.on_card->memory->height;
  }
  facts.error = shot.error;
  facts.untouched = shot.untouched;
  facts.tracking = shot.track.status;
  facts.tracking_trouble = shot.track.reason;
  if (shot.shown_pose) facts.held_s = shot.shown_pose->held_s;
  if (shot.track.pose) {
    facts.tags = static_cast<int>(shot.track.pose->tags.size());
    double variance_m2 = 0;  // of the position: the lower half of the 6x6 matrix's diagonal
    for (const std::size_t axis : {3, 4, 5}) variance_m2 += shot.track.pose->covariance[7 * axis];
    facts.deviation_mm = 1e3 * std::sqrt(variance_m2);
  }
  return facts;
}

std::string words_of(const fit::Figure& figure) {
  if (!figure.things_off.empty()) return words_of(figure.things_off);
  if (!figure.off) return "model: no figure: " + figure.why;
  const double off_px = fit::off_px(figure);
  if (off_px > fit::most_off_px)
    return fmt::format("model off by {}: check phantom or tags", pixels(off_px));
  return fmt::format("model {:.1f} px (90 % {:.1f})", figure.off->median_px, figure.off->most_px);
}

OsdPage osd_page(const RigFacts& rig, const PictureFacts* picture, const Pace& pace) {
  OsdPage page;
  const live::Look& look = rig.look;
  page.top_left.push_back(mode(look));
  if (look.state.recording)
    page.top_left.push_back({"● " + clock(rig.recorded_s), OsdTone::recording});
  if (look.state.recording && !rig.take.empty()) page.top_left.push_back({rig.take});
  if (look.view != render::View::composite)
    page.top_left.push_back({std::string("view: ") + render::name_of(look.view), OsdTone::mode});
  if (!rig.device.empty()) page.top_right.push_back({rig.device});
  if (rig.free_bytes) page.top_right.push_back(space(*rig.free_bytes));
  if (picture) {
    page.bottom_left.push_back({samples(*picture, look)});
    if (look.state.mode != live::Mode::refine && pace.fps > 0)
      page.bottom_left.push_back(
          {fmt::format("{:.1f} fps · {:.0f} ms", pace.fps, 1e3 * pace.latency_s)});
    page.bottom_right.push_back(tracking_words(*picture));
  }
  if (rig.fit && rig.fit->off && tone_of(*rig.fit) == OsdTone::plain)
    page.bottom_right.push_back({words_of(*rig.fit)});
  page.bottom_right.push_back({std::string("light: ") + set::name_of(look.light_mode)});
  page.column = pass_times(rig);
  add_notices(rig, picture, page);
  return page;
}

}  // namespace previz::rig
