#include "daemon/core/live/live_render.hpp"

#include <algorithm>
#include <exception>
#include <thread>
#include <utility>

#include "drivers/host_clock.hpp"

namespace previz::live {

using pipeline::Shot;

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds mode_delay{100};  // how late a change of mode may be noticed
// A snapshot is of the first picture with virtual objects that comes within this time.
constexpr std::chrono::seconds plates_patience{1};
constexpr std::chrono::seconds light_interval{10};
constexpr const char* light_fit = "light of the set";
constexpr int most_round = 64;
constexpr double round_s = 1;
constexpr int most_samples = 1 << 24;  // above this the sums are no longer exact enough (P4)

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace

LiveRender::LiveRender(const set::Set& set, const pipeline::Newest<Look>& look, Inbox& inbox,
                       pipeline::Metrics& metrics, Channels channels, Wants wants,
                       std::stop_token stop)
    : set_(set),
      look_(look),
      inbox_(inbox),
      metrics_(metrics),
      channels_(channels),
      wants_(std::move(wants)),
      stop_(std::move(stop)),
      intake_(metrics, "render", channels.tracked),
      review_intake_(metrics, "review", channels.reviewed) {
  if (set.quality.fps > 0) governor_.emplace(set.quality.fps, pipeline::preview_steps(set.quality));
}

bool LiveRender::interrupted() const {
  return stop_.stop_requested() || (refining_ && look_.get()->state.mode != Mode::refine);
}

void LiveRender::use(pipeline::RenderStage& stage) {
  stage_ = &stage;
  is_first_ = true;
  counted_ = stage.renderer()->work();
}

void LiveRender::drop_under_way(const char* cause) {
  for (const UnderWay& picture : under_way_) count_failed(picture.of_take, cause);
  under_way_.clear();
}

void LiveRender::use_none(const char* cause) {
  drop_under_way(cause);
  stage_ = nullptr;
  measure_nothing();
  refining_ = false;
  refined_.reset();
}

bool LiveRender::finished() const {
  return (channels_.tracked.finished() && under_way_.empty()) ||
         (!stage_ && stop_.stop_requested());
}

std::optional<Shot> LiveRender::next(const std::function<bool(const render::DeviceLost&)>& renew) {
  try {
    return next_picture();
  } catch (const render::DeviceLost& lost) {
    use_none("device lost");
    renew(lost);
    return std::nullopt;
  }
}

std::optional<Shot> LiveRender::next_picture() {
  if (!stage_) return std::nullopt;  // a stop came before the device was there again
  count_dropped();
  const std::shared_ptr<const Look> look = look_.get();
  save_refined(*look);
  if (look->state.mode != Mode::refine || look->refinements != refinements_) refining_ = false;
  if (!look->of_take) good_of_take_.reset();
  refinements_ = look->refinements;
  if (look->state.mode == Mode::refine && !under_way_.empty()) return complete();
  return look->state.mode == Mode::refine ? refine_round(*look) : wait_for_frame(*look);
}

std::optional<Shot> LiveRender::next_plate(const std::string& untouched) {
  count_dropped();
  const std::shared_ptr<const Look> look = look_.get();
  std::optional<Shot> shot = take_frame(*look, /*is_to_be_rendered=*/false, mode_delay);
  if (!shot) return std::nullopt;
  try {
    shot->picture = plate_of(*shot);
  } catch (const std::exception&) {
    if (!look->of_take) metrics_.dropped("render", "failed");
    return std::nullopt;
  }
  shot->untouched = untouched;
  shot->whole = true;
  count_shown(look->of_take);
  return shot;
}

// A reviewed frame was not captured now.
void LiveRender::count_shown(bool of_take) {
  if (of_take)
    metrics_.count("pictures reviewed");
  else
    metrics_.worked("render", 0);
}

std::optional<Shot> LiveRender::refine_round(const Look& look) {
  if (!good_of(look)) return wait_for_frame(look);
  while (channels_.tracked.try_pop()) metrics_.dropped("render", "refining");
  if (refining_ && refined_edits_ != edits_of(look)) refining_ = false;  // P14: moved meanwhile
  if (!refining_ && !begin_refinement(look)) return std::nullopt;
  Shot& shot = *good_of(look);
  if (shot.samples >= most_samples) {  // the finished picture stays on the screen
    std::this_thread::sleep_for(mode_delay);
    return refined_;
  }
  const auto begin = Clock::now();
  const int round = next_round(look);
  if (!stage_->add_samples(round)) {
    refining_ = false;
    count_work();
    return std::nullopt;
  }
  shot.samples += round;
  sample_s_ = seconds_since(begin) / round;
  Shot shown = shot;
  stage_->show(look.view);
  stage_->finish(shown);
  shown.error = stage_->error();
  refined_ = shown;
  metrics_.busy("refine", seconds_since(begin));
  metrics_.count("refine rounds");
  measure(count_work(), /*is_round=*/true);
  return shown;
}

// Each round doubles the samples, but takes at most about a second, so that the crew sees the
// picture improve.
int LiveRender::next_round(const Look& look) {
  const int done = good_of(look)->samples;
  const int wanted = done == 0 ? look.samples : std::min(done, most_round);
  if (!(sample_s_ > 0)) return 1;  // one sample measures the pace
  return std::clamp(static_cast<int>(round_s / sample_s_), 1, wanted);
}

// A refinement has full size, whatever the preview's, and stands alone: it shows the picture that
// `previz render` makes.
bool LiveRender::begin_refinement(const Look& look) {
  Shot& shot = *good_of(look);
  refined_.reset();
  shot.samples = 0;
  // Things may have moved since the frame was captured: in standby, or without a camera or tags.
  shot.scene = look.of_take ? pipeline::with_edits(recorded_, set_, look.take_edits)
                            : pipeline::scene_state(set_, look.edits, shot.motion);
  stage_->fill_layers(true);
  set::Quality quality = set_.quality;  // the preview's may be denoised otherwise
  quality.accumulate = false;
  stage_->use(quality);
  stage_->use(look.estimator);
  stage_->resize(1);
  refining_ = stage_->begin(shot);
  refined_edits_ = edits_of(look);
  return refining_;
}

std::optional<Shot>& LiveRender::good_of(const Look& look) {
  return look.of_take ? good_of_take_ : good_;
}

const pipeline::Edits& LiveRender::edits_of(const Look& look) {
  return look.of_take ? look.take_edits : look.edits;
}

void LiveRender::publish_found(const pipeline::LightPtr& light) {
  if (!light || light == found_in_) return;
  found_in_ = light;
  channels_.found.set(pipeline::found_lamps(*light));
}

// If the next frame is already waiting, it is handed to the device before the last one's picture is
// fetched, so that the device does not idle meanwhile. A snapshot, or a layer in place of the
// composite, is rendered to its end as soon as it is started, and would hold up the last picture.
std::optional<Shot> LiveRender::wait_for_frame(const Look& look) {
  if (under_way_.empty()) {
    std::optional<Shot> shot = take_frame(look, /*is_to_be_rendered=*/true, mode_delay);
    if (!shot) return std::nullopt;
    start(look, *std::move(shot));
  }
  const bool is_light_due = !look.of_take && Clock::now() >= light_due_;
  const bool can_overlap =
      !wants_snapshot(look) && look.view == render::View::composite && !is_light_due;
  if (can_overlap && !under_way_.front().picture.is_here())
    if (std::optional<Shot> next =
            take_frame(look, /*is_to_be_rendered=*/true, std::chrono::milliseconds(0))) {
      metrics_.count("begun before the last picture was there");
      start(look, *std::move(next));
    }
  Shot shot = complete();
  if (is_light_due && under_way_.empty() && shot.whole && shot.untouched.empty())
    compare_light(shot);
  return shot;
}

// Between two pictures, at a hundredth of the time at most.
void LiveRender::compare_light(const Shot& shot) {
  const auto begin = Clock::now();
  pipeline::LightComparison comparison;
  counting_failure(false, [&] { stage_->compare_light(shot, comparison); });
  const auto took = Clock::now() - begin;
  light_due_ = begin + std::max<Clock::duration>(light_interval, 100 * took);
  metrics_.busy("light against picture", std::chrono::duration<double>(took).count());
  const auto figure = comparison.figure();
  if (!figure) return;
  const std::string remark = pipeline::light_remark(*figure);
  if (remark.empty()) return channels_.reports.settle(light_fit);
  channels_.reports(
      report::once({.severity = report::Severity::warning,
                    .source = light_fit,
                    .text = remark,
                    .notice = report::Notice{report::Severity::warning, light_fit,
                                             pipeline::light_notice(*figure), true}}));
}

bool LiveRender::wants_snapshot(const Look& look) const {
  return look.snapshots > snapshots_ || look.refined_snapshots > refined_snapshots_;
}

// A frame that came while tracking rested has neither pose nor light, and its plate all the same.
std::optional<Shot> LiveRender::take_frame(const Look& look, bool is_to_be_rendered,
                                           std::chrono::milliseconds wait) {
  const bool review = look.of_take;
  std::optional<Shot> shot = (review ? channels_.reviewed : channels_.tracked).pop_for(wait);
  if (review && channels_.tracked.try_pop()) metrics_.dropped("render", "review");
  if (!shot) return std::nullopt;
  if (look.state.mode == Mode::standby) {
    metrics_.dropped("render", "standby");
    return std::nullopt;
  }
  if (is_to_be_rendered && !shot->tracking_done) {
    metrics_.dropped("render", "refining");
    return std::nullopt;
  }
  return shot;
}

// A number of samples that a button asks for keeps the size that the rate had brought about, so
// that it changes the samples alone.
double LiveRender::govern(const Look& look, set::Quality& quality) const {
  if (!governor_) return set_.quality.scale;
  const set::PreviewStep& step = governor_->step();
  quality.denoise = step.denoise.value_or(quality.denoise);
  if (look.governed) {
    quality.samples = governor_->samples();
    quality.error = quality.seconds = 0;
  }
  return step.scale;
}

// Hands the shot's frame over to the device, and does not wait for the picture.
void LiveRender::start(const Look& look, Shot shot) {
  const auto begin = Clock::now();
  set::Quality quality = set_.quality;
  quality.samples = look.samples;
  quality.adaptive = false;
  quality.accumulate = look.accumulates;
  const double scale = govern(look, quality);
  // If a refinement ended before its first round, this picture is the only one to save for it.
  const bool snapshot = wants_snapshot(look);
  // A snapshot can be compared with what `previz render` makes of its frame.
  if (snapshot && shot.track.pose) shot.shown_pose.reset();
  // The crew's changes go on top of what was recorded, never in its place.
  std::optional<session::SceneState> recorded;
  if (pipeline::RecordedLook was{shot.scene.variants, shot.scene.hides_tags};
      look.of_take && was != *channels_.recorded_look.get())
    channels_.recorded_look.set(std::move(was));
  if (look.of_take)
    recorded = std::exchange(shot.scene, pipeline::with_edits(shot.scene, set_, look.take_edits));
  counting_failure(look.of_take, [&] {
    publish_found(shot.light);
    stage_->use(quality);
    stage_->use(look.estimator);
    stage_->show(look.view);
    stage_->fill_layers(snapshot);
    stage_->resize(scale);
    const bool is_composite = look.view == render::View::composite;
    const render::ShowTo to = wants_ ? wants_(stage_->renderer()->card()) : render::ShowTo{};
    under_way_.push_back({.picture = stage_->start(std::move(shot), to),
                          .recorded = std::move(recorded),
                          .of_take = look.of_take,
                          .governed = look.governed,
                          .snapshot = snapshot,
                          .of_live = look.snapshots > snapshots_,
                          .is_for_card = to.card && !snapshot && is_composite,
                          .samples = governor_ ? governor_->samples() : 0,
                          .step = governor_ ? governor_->step() : set::PreviewStep{},
                          .begin = begin});
  });
}

// Counts the hand-overs, waits and copies between the computer and the device, which take time that
// no pass explains, and the pipelines, each of which the picture that waits for it may miss.
// Returns how long the passes took.
render::DeviceTimes LiveRender::count_work() {
  const render::DeviceWork work = stage_->renderer()->work();
  const render::DeviceWork before = std::exchange(counted_, work);
  metrics_.device_counted(
      "graphics", {{"submissions", work.submissions - before.submissions},
                   {"waits", work.waits - before.waits},
                   {"allocations", work.allocations - before.allocations},
                   {"bytes up", work.bytes_up - before.bytes_up},
                   {"bytes down", work.bytes_down - before.bytes_down},
                   {"pipelines awaited", work.pipelines_awaited - before.pipelines_awaited},
                   {"pipelines made ahead", work.pipelines_ahead - before.pipelines_ahead}});
  render::DeviceTimes times = stage_->renderer()->take_times();
  metrics_.passes_ran(times);
  return times;
}

// Averages what was rendered, if the crew looks at it.
void LiveRender::measure(render::DeviceTimes times, bool is_round) {
  const std::shared_ptr<const Look> look = look_.get();
  if (!look->osd || !look->pass_times) return measure_nothing();
  if (!meter_) meter_.emplace();
  if (meter_->add(monotonic_ns(), std::move(times), is_round))
    channels_.pass_times.set(meter_->read());
}

void LiveRender::measure_nothing() {
  if (!meter_) return;
  meter_.reset();
  channels_.pass_times.set(std::nullopt);
}

// A reviewed frame was not captured now, so its loss is not counted.
void LiveRender::count_failed(bool of_take, const char* cause) {
  if (!of_take) metrics_.dropped("render", cause);
}

// Does the work for a frame; if that fails, counts the frame and passes the exception on.
void LiveRender::counting_failure(bool of_take, const std::function<void()>& work) {
  try {
    work();
  } catch (const render::DeviceLost&) {
    count_failed(of_take, "device lost");
    throw;
  } catch (...) {
    count_failed(of_take, "failed");
    throw;
  }
}

// Returns the picture that has been under way for longest, once it is there.
Shot LiveRender::complete() {
  UnderWay under_way = std::move(under_way_.front());
  under_way_.pop_front();
  Shot shot;
  counting_failure(under_way.of_take, [&] { shot = stage_->finish(std::move(under_way.picture)); });
  // Where pictures overlap, each takes as long as it is there after the one before.
  const double took = seconds_since(std::max(under_way.begin, completed_));
  completed_ = Clock::now();
  if (shot.render_s > 0) shot.render_s = took;
  metrics_.busy("render", took);
  count_shown(under_way.of_take);
  render::DeviceTimes times = count_work();
  if (!shot.whole) return shot;
  if (shot.on_card) metrics_.count("stayed in the card's memory");
  if (shot.untouched.empty()) measure(std::move(times), /*is_round=*/false);
  if (shot.untouched.empty()) {
    if (under_way.is_for_card && !shot.on_card)
      metrics_.count("copied to the screen for want of card memory");
    if (shot.track.pose) keep_as_good(shot, std::move(under_way.recorded));
    if (under_way.governed && governor_) {
      // The governor may have changed its mind since the frame was started.
      const bool is_as_governed =
          under_way.samples == governor_->samples() && under_way.step == governor_->step();
      if (!is_first_ && !under_way.snapshot && is_as_governed) governor_->took(took);
      set::PreviewStep step = governor_->step();
      step.samples = governor_->samples();
      channels_.governed.set(step);
    }
    is_first_ = false;
  }
  if (under_way.snapshot) {
    const Clock::time_point since = snapshot_since_.value_or(under_way.begin);
    if (!shot.untouched.empty() && Clock::now() - since < plates_patience) {
      snapshot_since_ = since;
      return shot;
    }
    snapshot_since_.reset();
    ++(under_way.of_live ? snapshots_ : refined_snapshots_);
    save(shot);
  }
  return shot;
}

// Keeps the frame with its tracked pose, light and scene, but without the rendered picture: a
// refinement shows what `previz render` makes of the frame.
void LiveRender::keep_as_good(const Shot& shot, std::optional<session::SceneState> recorded) {
  if (!good_ && !good_of_take_) inbox_.post(Event::good_frame);
  Shot good;
  good.index = shot.index;
  good.frame = shot.frame;
  good.camera = shot.camera;
  good.plate = shot.plate;
  good.arrived = shot.arrived;
  good.track = shot.track;
  good.light = shot.light;
  good.motion = shot.motion;
  good.scene = shot.scene;
  good.tracking_done = true;
  good.frozen = true;
  (recorded ? good_of_take_ : good_) = std::move(good);
  if (recorded) recorded_ = std::move(*recorded);
}

// Saves the picture that was on the screen when the button went down, even if the press ended the
// refinement and another picture was shown before its kind was known.
void LiveRender::save_refined(const Look& look) {
  while (refined_ && refined_snapshots_ < look.refined_snapshots) {
    ++refined_snapshots_;
    save(*refined_);
  }
}

// The picture goes on while a disk hangs, and no more snapshots wait for it than the queue has room
// for.
void LiveRender::save(const Shot& shot) {
  if (!shot.untouched.empty()) return inbox_.post({"nothing is saved: " + shot.untouched, false});
  if (channels_.snapshots.offer(shot)) return;
  if (stop_.stop_requested()) return metrics_.dropped("snapshot", "stopped");
  metrics_.dropped("snapshot", "queue full");
  inbox_.post({"is skipped, because earlier ones are not on the disk yet", false});
}

}  // namespace previz::live
