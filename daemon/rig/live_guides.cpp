#include "daemon/rig/live_guides.hpp"

#include <utility>

#include "daemon/rig/marking_lines.hpp"

namespace previz::rig {

using Clock = std::chrono::steady_clock;
using pipeline::Shot;

namespace {

constexpr std::chrono::seconds figure_interval{1};
constexpr std::chrono::milliseconds look_interval{100};  // at whether the guides are on
constexpr const char* stage_name = "model fit";

// What lines over a picture are made of.
struct UnderLines {
  std::shared_ptr<pipeline::Newest<std::shared_ptr<const GuideModel>>> model;
  PinholeIntrinsics lens;
  std::optional<GuideModel::View> view;  // absent: nobody knows where the camera was
};

std::shared_ptr<const output::GuidePage> lines_over(const UnderLines& picture,
                                                    const live::Look& look) {
  std::optional<output::GuidePage> page;
  const auto model = *picture.model->get();
  if (look.guides && model && picture.view) page = model->guides_of(*picture.view);
  const bool is_whole = !look.guides || model;
  if (look.marking.is_on && look.state.mode == live::Mode::live) {
    const output::GuidePage marks =
        marking_lines(look.marking, picture.lens,
                      picture.view ? std::optional(picture.view->world_from_camera) : std::nullopt);
    if (!page) page = output::GuidePage{marks.width, marks.height, {}, {}, is_whole};
    page->lines.insert(page->lines.end(), marks.lines.begin(), marks.lines.end());
    page->words.insert(page->words.end(), marks.words.begin(), marks.words.end());
  }
  return page ? std::make_shared<const output::GuidePage>(*std::move(page)) : nullptr;
}

}  // namespace

LiveGuides::LiveGuides(Parts parts, const ObserverCalibration& camera)
    : parts_(std::move(parts)),
      camera_(camera),
      model_(std::make_shared<pipeline::Newest<ModelPtr>>(nullptr)) {
  thread_ = std::jthread([this] { run(); });
}

LiveGuides::~LiveGuides() {
  seen_.abandon();
  thread_.join();
  parts_.kept.metrics.model_fit(std::nullopt);
}

GuidesOf LiveGuides::look_at(const Shot& shot) {
  if (parts_.look.get()->guides && Clock::now() - offered_ >= figure_interval) {
    offered_ = Clock::now();
    Seen seen{shot.frame, {}};
    if (shot.track.pose) seen.world_from_camera = shot.track.pose->world_from_camera;
    seen_.push(std::move(seen));
  }
  UnderLines picture{.model = model_, .lens = camera_.intrinsics, .view = {}};
  if (const glm::dmat4* pose = world_from_camera(shot))
    picture.view = GuideModel::View{*pose, shot.scene, shot.motion.carriers};
  return
      [picture = std::move(picture)](const live::Look& look) { return lines_over(picture, look); };
}

void LiveGuides::run() {
  pipeline::StageKeeper keeper(stage_name, parts_.kept, &pipeline::Patience::set);
  while (!seen_.finished()) {
    const std::optional<Seen> seen = seen_.pop_for(look_interval);
    if (!parts_.look.get()->guides) {
      if (!figure()) continue;
      things_ = {};
      publish(std::nullopt);
    } else if (seen || !*model_->get()) {
      keeper.attempt([&] {
        if (!*model_->get()) make_model();
        if (seen) measure(*seen);
      });
    }
  }
}

void LiveGuides::make_model() {
  model_->set(std::make_shared<const GuideModel>(parts_.scene, parts_.set, camera_));
}

void LiveGuides::measure(const Seen& seen) {
  if (!seen.world_from_camera) {
    fit::Figure none;
    none.why = "the camera's place is not known";
    return publish(none);
  }
  const auto begin = Clock::now();
  const ModelPtr model = *model_->get();
  fit::Measurement measurement(model->real(), model->camera(), std::move(things_));
  measurement.look(*seen.frame, *seen.world_from_camera);
  things_ = measurement.parts();
  publish(measurement.figure());
  parts_.kept.metrics.worked(stage_name,
                             std::chrono::duration<double>(Clock::now() - begin).count());
}

void LiveGuides::publish(const std::optional<fit::Figure>& figure) {
  figure_.set(figure);
  std::optional<pipeline::ModelFit> fit;
  if (figure && (figure->off || !figure->things_off.empty())) {
    fit.emplace();
    if (figure->off)
      fit->all = {figure->off->median_px, figure->off->most_px, figure->off->shift_px};
    for (const fit::PartOff& thing : figure->things_off)
      fit->things_off.emplace_back(thing.name, thing.shift_px);
  }
  parts_.kept.metrics.model_fit(fit);
}

}  // namespace previz::rig
