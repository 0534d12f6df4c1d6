#include "daemon/rig/review.hpp"

#include <chrono>
#include <stop_token>
#include <utility>
#include <variant>

#include "daemon/pipeline/recorded_light.hpp"
#include "daemon/pipeline/take.hpp"
#include "daemon/pipeline/track_stage.hpp"
#include "drivers/error.hpp"
#include "drivers/replay/replay_camera.hpp"

namespace previz::rig {

using report::Reports;
using report::Severity;

namespace {

void play(const std::stop_token& stop, const std::filesystem::path& directory,
          const std::string& set_text, pipeline::Mailbox<pipeline::Shot>& out, Reports& reports) {
  pipeline::Take take = pipeline::open_take(directory, {});
  if (take.set_text != set_text)
    throw Error(directory.string() + ": was recorded with another set; run that one to review it");
  for (const std::string& what : take.session.missing)
    reports(report::once({Severity::warning, directory.string(), what}));
  if (!take.session.track.empty()) take.set.tracking.enabled = false;
  pipeline::TrackStage track(take.set, take.observer, take.session.track, pipeline::start_of(take));
  pipeline::RecordedLight light(take.set, take.light, take.observer, std::move(take.light_stream),
                                directory);
  const std::unique_ptr<Camera> camera = replay(std::move(take.observer_stream), "review");
  camera->start();

  std::uint64_t index = 0;
  while (!stop.stop_requested()) {
    CameraEvent event = camera->next(std::chrono::milliseconds(100));
    if (std::holds_alternative<EndOfStream>(event)) return;
    if (const auto* trouble = std::get_if<DeviceTrouble>(&event))
      reports(report::once({Severity::error, trouble->device, trouble->what}));
    auto* frame = std::get_if<FramePtr>(&event);
    if (!frame) continue;
    pipeline::Shot shot;
    shot.index = index++;
    shot.frame = std::move(*frame);
    shot.arrived = std::chrono::steady_clock::now();
    track(shot);
    shot.light = light.at(shot);
    for (const std::string& trouble : light.troubles())
      reports(report::once({Severity::warning, "light", trouble}));
    out.push(std::move(shot));
  }
}

}  // namespace

Review::Review(std::filesystem::path take, std::string set_text,
               pipeline::Mailbox<pipeline::Shot>& out, Inbox& inbox, Reports& reports)
    : thread_([take = std::move(take), set_text = std::move(set_text), &out, &inbox, &reports,
               this](const std::stop_token& stop) {
        try {
          play(stop, take, set_text, out, reports);
        } catch (const std::exception& error) {
          reports({Severity::error, "review", error.what()});
        }
        if (!stop.stop_requested()) inbox.post(Event::review_ended);
        done_ = true;
      }) {}

}  // namespace previz::rig
