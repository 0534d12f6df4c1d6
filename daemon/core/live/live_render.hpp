// The work of the rig's render thread: it renders each new frame, or refines the last good one in
// rounds, as the Look says.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/core/live/inbox.hpp"
#include "daemon/core/live/look.hpp"
#include "daemon/core/live/pass_meter.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/governor.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/report/reports.hpp"

namespace previz::live {

class LiveRender {
 public:
  struct Channels {
    pipeline::Mailbox<pipeline::Shot>& tracked;                 // the camera's
    pipeline::Mailbox<pipeline::Shot>& reviewed;                // a take's, with their light
    pipeline::BoundedQueue<pipeline::Shot>& snapshots;          // output, with layers
    pipeline::Newest<std::vector<pipeline::FoundLamp>>& found;  // output, of the last light
    pipeline::Newest<set::PreviewStep>& governed;               // output, as the rate is held
    // Output: what the last reviewed frame was recorded with.
    pipeline::Newest<pipeline::RecordedLook>& recorded_look;
    // Output: what each pass takes, while the overlay shows it.
    pipeline::Newest<std::optional<PassTimes>>& pass_times;
    report::Reports& reports;  // of a light that does not fit the picture
  };

  // Returns where the pictures of this device are wanted; empty: they come down.
  using Wants = std::function<render::ShowTo(const std::optional<CardIdentity>& card)>;

  // The stage that renders must ask interrupted() whether it is cancelled.
  LiveRender(const set::Set& set, const pipeline::Newest<Look>& look, Inbox& inbox,
             pipeline::Metrics& metrics, Channels channels, Wants wants, std::stop_token stop);

  void use(pipeline::RenderStage& stage);
  // Forgets a stage that has failed, and the refinement that it was at; there is none until use().
  // What was under way is counted as dropped for this cause.
  void use_none(const char* cause = "failed");
  void drop_under_way(const char* cause);

  // Returns the next picture to show, or nothing if none came within a moment. There must be a
  // stage to use(). If the device is lost, `renew` is called; it returns true once there is another
  // stage, and false if a stop came first. Any other exception of the stage is passed on; the frame
  // is counted as dropped. A refinement starts with the preview's samples, and each round doubles
  // them, by at most 64 samples and about a second's worth.
  std::optional<pipeline::Shot> next(const std::function<bool(const render::DeviceLost&)>& renew);
  // Returns the next frame with its plate for a picture, untouched for this reason, where there is
  // no stage; nothing if none came within a moment.
  std::optional<pipeline::Shot> next_plate(const std::string& untouched);
  // Returns true once nothing will ever come.
  bool finished() const;

  // Counts the frames that newer ones replaced since the last call; next() and next_plate() do so
  // too.
  void count_dropped() {
    intake_.update();
    review_intake_.update();
  }

  // Returns true if the picture that is being rendered is no longer wanted. Call it from the render
  // thread.
  bool interrupted() const;

 private:
  std::optional<pipeline::Shot> next_picture();
  void save_refined(const Look& look);
  void save(const pipeline::Shot& shot);
  std::optional<pipeline::Shot> refine_round(const Look& look);
  int next_round(const Look& look);
  bool begin_refinement(const Look& look);
  std::optional<pipeline::Shot> wait_for_frame(const Look& look);
  std::optional<pipeline::Shot> take_frame(const Look& look, bool is_to_be_rendered,
                                           std::chrono::milliseconds wait);
  void count_shown(bool of_take);
  // A picture that the device is at work on, or that is there.
  struct UnderWay {
    pipeline::ShotUnderWay picture;
    std::optional<session::SceneState> recorded;  // of a take's frame: its scene
    bool of_take, governed, snapshot, of_live;    // as the Look was
    bool is_for_card;                             // it is wanted there
    int samples;                                  // the governor's
    set::PreviewStep step;                        // likewise
    std::chrono::steady_clock::time_point begin;
  };
  void start(const Look& look, pipeline::Shot shot);
  pipeline::Shot complete();
  void compare_light(const pipeline::Shot& shot);
  bool wants_snapshot(const Look& look) const;
  render::DeviceTimes count_work();
  void measure(render::DeviceTimes times, bool is_round);
  void measure_nothing();
  void count_failed(bool of_take, const char* cause);
  void counting_failure(bool of_take, const std::function<void()>& work);
  void keep_as_good(const pipeline::Shot& shot, std::optional<session::SceneState> recorded);
  std::optional<pipeline::Shot>& good_of(const Look& look);
  // Puts what the governor has chosen into the quality, as far as the rate is held, and returns the
  // size of the picture.
  double govern(const Look& look, set::Quality& quality) const;
  static const pipeline::Edits& edits_of(const Look& look);
  void publish_found(const pipeline::LightPtr& light);

  const set::Set& set_;
  const pipeline::Newest<Look>& look_;
  Inbox& inbox_;
  pipeline::Metrics& metrics_;
  Channels channels_;
  const Wants wants_;
  const std::stop_token stop_;
  pipeline::RenderStage* stage_ = nullptr;
  std::optional<pipeline::Governor> governor_;
  render::DeviceWork counted_;      // of the stage's device
  std::optional<PassMeter> meter_;  // of the stage's device, while the overlay shows the times
  bool is_first_ = true;  // no picture came of the stage yet; the first one compiles its pipelines
  // The last shots with pose and light, of the rig and of the take in review: their frames only.
  std::optional<pipeline::Shot> good_, good_of_take_;
  session::SceneState recorded_;  // the scene that good_of_take_ was recorded with
  pipeline::LightPtr found_in_;   // the light that the found lamps were published of
  // When the light is compared with the picture again.
  std::chrono::steady_clock::time_point light_due_;
  std::optional<pipeline::Shot> refined_;            // result of the last round, with layers
  std::deque<UnderWay> under_way_;                   // pictures that were started, at most two
  std::chrono::steady_clock::time_point completed_;  // when the last one was there
  bool refining_ = false;
  pipeline::Edits refined_edits_;
  double sample_s_ = 0;  // time of the last refinement's sample; 0: not known
  pipeline::Intake<pipeline::Shot> intake_, review_intake_;
  std::optional<std::chrono::steady_clock::time_point> snapshot_since_;    // plates came instead
  std::uint64_t snapshots_ = 0, refined_snapshots_ = 0, refinements_ = 0;  // the Look's, done
};

}  // namespace previz::live
