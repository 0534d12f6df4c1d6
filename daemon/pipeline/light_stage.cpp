#include "daemon/pipeline/light_stage.hpp"

#include <algorithm>
#include <utility>

#include "daemon/lighting/light_mode.hpp"
#include "daemon/lighting/sources.hpp"
#include "daemon/pipeline/room_model.hpp"
#include "daemon/set/names.hpp"
#include "drivers/bracket.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

// Returns the light as track.jsonl carries it: its sources, and everything else as
// lighting::blurred leaves it. Light of lighting.mode = "sources" can be restored from this record
// bit for bit.
session::CapturedLight to_record(const lighting::Lighting& lighting) {
  session::CapturedLight record;
  for (const lighting::Source& source : lighting.sources)
    record.sources.push_back({source.id, source.direction, source.solid_angle_sr, source.flux});
  lighting::EnvironmentMap ambient = lighting::blurred(lighting.environment);
  record.ambient_size = ambient.size;
  record.ambient = std::move(ambient.radiance);
  return record;
}

lighting::Lighting from_record(const session::CapturedLight& record) {
  lighting::Lighting lighting;
  for (const session::CapturedSource& source : record.sources)
    lighting.sources.push_back({source.id, source.direction, source.solid_angle_sr, source.flux});
  lighting.environment = {record.ambient_size, record.ambient};
  return lighting;
}

bool is_exposure(double exposure) {
  return exposure > 0 && std::isfinite(exposure);
}

}  // namespace

LightStage::LightStage(const set::Set& set, std::optional<LightCameraCalibration> calibration,
                       const ObserverCalibration& observer)
    : settings_(set.lighting),
      exposure_(set.light_camera.exposure),
      observer_exposure_(set.observer.exposure),
      tracker_(set.lighting.smoothing_s) {
  if (given()) {
    if (settings_.environment) given_ = lighting::load_environment(settings_);
    show_given();
    return;
  }
  if (calibration) {
    room_ = open_room(set, glm::dvec3(calibration->world_from_camera[3]));
    seen_from_ = room_ ? room_->seen_from() : glm::dvec3(calibration->world_from_camera[3]);
  }
  if (settings_.from == set::LightFrom::recording) return;
  if (!calibration)
    throw Error(set.file.string() +
                ": lighting: neither lighting.environment nor a light camera with a calibration is "
                "given; one of them must light the set, or with from = \"set\" its own lights");
  intrinsics_ = calibration->intrinsics;
  estimator_.emplace(*calibration, settings_, room_);
  if (settings_.unseen == set::UnseenRule::observer)
    observed_ =
        std::make_unique<lighting::ObservedLight>(observer, estimator_->resolution(), room_);
}

// True if the set file fixes the light, so that it never changes.
bool LightStage::given() const {
  return settings_.environment || settings_.from == set::LightFrom::set;
}

void LightStage::show_given() {
  light_ = finished(given_, {}, 0);
}

bool LightStage::remembers() const {
  return needs_frames() &&
         (settings_.smoothing_s > 0 || needs_observer() || settings_.mode != set::LightMode::image);
}

// There is no bracket to wait for if the set states the exposure or names the frame to use.
void LightStage::await_bracket(std::size_t exposures) {
  if (!exposure_ && settings_.frame < 0)
    awaited_ = std::clamp(exposures, std::size_t{1}, most_exposures);
}

void LightStage::use(set::LightMode mode) {
  if (settings_.mode == mode) return;
  if (settings_.from == set::LightFrom::recording) {
    troubles_.push_back(std::string("a recording has sources and no picture: light mode ") +
                        set::name_of(mode) + " cannot be had of it");
    return;
  }
  settings_.mode = mode;
  if (given()) show_given();
  changed_ = !newest_.empty();
}

bool LightStage::usable(const Frame& frame) {
  const std::string name = "light frame " + std::to_string(frame.sequence);
  if (frame.width != intrinsics_.width || frame.height != intrinsics_.height)
    troubles_.push_back(name + " is left out: it has " + std::to_string(frame.width) + "x" +
                        std::to_string(frame.height) + " pixels, the calibration " +
                        std::to_string(intrinsics_.width) + "x" +
                        std::to_string(intrinsics_.height));
  else if (!is_exposure(frame.exposure))
    troubles_.push_back(name + " is left out: its exposure is " + std::to_string(frame.exposure) +
                        "; it must be above 0");
  else
    return true;
  return false;
}

void LightStage::drop_oldest() {
  const auto oldest = std::ranges::min_element(
      newest_, {}, [](const auto& entry) { return entry.second->timestamp_ns; });
  troubles_.push_back("light frame " + std::to_string(oldest->second->sequence) +
                      " is left out: more than " + std::to_string(most_exposures) +
                      " different exposures were seen since");
  newest_.erase(oldest);
}

// Places the image's sources at the distance that the set or its room gives, as seen from
// seen_from_.
LightPtr LightStage::placed(lighting::Lighting lighting, std::vector<std::uint64_t> sequences,
                            session::CapturedLight record) const {
  Light light;
  light.lamps = lighting::lamps_of(
      lighting.sources, seen_from_, [&](const glm::dvec3& direction) -> std::optional<double> {
        if (settings_.sources.distance_m) return settings_.sources.distance_m;
        return room_ ? room_->distance(seen_from_, direction) : std::nullopt;
      });
  light.encoded = render::encode_environment(lighting.environment);
  light.lighting = std::move(lighting);
  light.sequences = std::move(sequences);
  light.record = std::move(record);
  return std::make_shared<const Light>(std::move(light));
}

// A take always carries sources, even if the picture is lit by the image.
LightPtr LightStage::finished(lighting::Lighting lighting, std::vector<std::uint64_t> sequences,
                              std::int64_t timestamp_ns) {
  session::CapturedLight record;
  if (settings_.mode == set::LightMode::image) {
    lighting::Lighting as_sources = lighting;
    set::Lighting settings = settings_;
    settings.mode = set::LightMode::hybrid;
    lighting::apply_mode(as_sources, settings, tracker_, timestamp_ns);
    record = to_record(as_sources);
  } else {
    lighting::apply_mode(lighting, settings_, tracker_, timestamp_ns);
    record = to_record(lighting);
  }
  return placed(std::move(lighting), std::move(sequences), std::move(record));
}

void LightStage::see(FramePtr frame, std::uint64_t index) {
  if (!needs_frames() ||
      (settings_.frame >= 0 && index != static_cast<std::uint64_t>(settings_.frame)))
    return;
  ++seen_;
  if (exposure_) {
    auto exposed = std::make_shared<Frame>(*frame);
    exposed->exposure = *exposure_;
    frame = std::move(exposed);
  }
  if (!usable(*frame)) return;
  newest_[exposure_step(frame->exposure)] = std::move(frame);
  if (newest_.size() > most_exposures) drop_oldest();
  changed_ = true;
}

void LightStage::see_observer(const Plate& plate, double exposure,
                              const glm::dmat4& world_from_camera) {
  if (!observed_) return;
  observed_->see(plate, observer_exposure_.value_or(exposure), world_from_camera);
  changed_ = changed_ || !newest_.empty();
}

LightPtr LightStage::light() {
  if (changed_ && !awaits_bracket()) {
    awaited_ = 1;
    std::vector<FramePtr> bracket;
    std::vector<std::uint64_t> sequences;
    std::int64_t newest_ns = 0;
    for (const auto& [exposure, frame] : newest_) {
      bracket.push_back(frame);
      sequences.push_back(frame->sequence);
      newest_ns = std::max(newest_ns, frame->timestamp_ns);
    }
    light_ = finished((*estimator_)(bracket, observed_.get()), std::move(sequences), newest_ns);
    changed_ = false;
  }
  return light_;
}

LightPtr LightStage::light_for(const Shot& shot) {
  if (settings_.from != set::LightFrom::recording) return light();
  if (!shot.recorded_light) return nullptr;
  // The light changes seldom; an unchanged one need not be put into the renderer again.
  if (!shown_ || *shown_ != *shot.recorded_light)
    light_ = placed(from_record(*shot.recorded_light), {}, *shot.recorded_light);
  shown_ = shot.recorded_light;
  return light_;
}

}  // namespace previz::pipeline
