#include "daemon/core/pipeline/light_stage.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "daemon/core/lighting/light_mode.hpp"
#include "daemon/core/lighting/sources.hpp"
#include "daemon/core/pipeline/room_model.hpp"
#include "daemon/core/set/names.hpp"
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
                       const ObserverCalibration& observer, const scene::Scene* scene)
    : settings_(set.lighting),
      captured_lamps_(set.captured_lamps),
      lights_(set.lights),
      exposure_(set.light_camera.exposure),
      observer_exposure_(set.observer.exposure),
      tracker_(set.lighting.smoothing_s) {
  if (calibration) seen_from_ = camera_place_ = glm::dvec3(calibration->world_from_camera[3]);
  if (given()) {
    if (settings_.environment) given_ = lighting::load_environment(settings_);
    if (settings_.environment) claim_lamps(set, scene, given_.environment.size);
    show_given();
    return;
  }
  if (calibration) {
    room_ = open_room(set, camera_place_);
    if (room_) seen_from_ = room_->seen_from();
  }
  if (settings_.from == set::LightFrom::recording) {
    claim_lamps(set, scene, 1);  // a recording has no map
    return;
  }
  if (!calibration)
    throw Error(
        set.file.string() +
        ": lighting: no light: give lighting.environment, a light camera with a calibration, "
        "or from = \"set\" with lamps in the set file");
  intrinsics_ = calibration->intrinsics;
  estimator_.emplace(*calibration, settings_, room_);
  claim_lamps(set, scene, estimator_->resolution());
  if (settings_.unseen == set::UnseenRule::observer)
    observed_ =
        std::make_unique<lighting::ObservedLight>(observer, estimator_->resolution(), room_);
}

void LightStage::claim_lamps(const set::Set& set, const scene::Scene* scene, int map_size) {
  claimed_ = claims_of(set, scene, camera_place_);
  troubles_.insert(troubles_.end(), claimed_.troubles.begin(), claimed_.troubles.end());
  const auto from_camera = [room = room_, from = seen_from_, camera = camera_place_](
                               const glm::dvec3& direction) -> std::optional<glm::dvec3> {
    const auto distance = room ? room->distance(from, direction) : std::nullopt;
    if (!distance) return direction;
    const glm::dvec3 point = from + *distance * direction;
    if (!room->sees(camera, point)) return std::nullopt;
    return glm::normalize(point - camera);
  };
  claims_ = lighting::Claims(claimed_.claims, map_size, from_camera);
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
    troubles_.push_back(std::string("a recording has lamps but no light picture: light mode ") +
                        set::name_of(mode) + " is not available");
    return;
  }
  settings_.mode = mode;
  if (given()) show_given();
  changed_ = !newest_.empty();
}

void LightStage::turn(double turn_rad) {
  if (!settings_.environment || turn_rad == turned_rad_) return;
  settings_.environment_rotation_rad += turn_rad - turned_rad_;
  turned_rad_ = turn_rad;
  given_ = lighting::load_environment(settings_);
  show_given();
}

bool LightStage::usable(const Frame& frame) {
  const std::string name = "light frame " + std::to_string(frame.sequence);
  if (frame.width != intrinsics_.width || frame.height != intrinsics_.height)
    troubles_.push_back(name + " is skipped: it has " + std::to_string(frame.width) + "x" +
                        std::to_string(frame.height) + " pixels, the calibration " +
                        std::to_string(intrinsics_.width) + "x" +
                        std::to_string(intrinsics_.height));
  else if (!is_exposure(frame.exposure))
    troubles_.push_back(name + " is skipped: its exposure is " + std::to_string(frame.exposure) +
                        "; it must be above 0");
  else
    return true;
  return false;
}

void LightStage::drop_oldest() {
  const auto oldest = std::ranges::min_element(
      newest_, {}, [](const auto& entry) { return entry.second->timestamp_ns; });
  troubles_.push_back("light frame " + std::to_string(oldest->second->sequence) +
                      " is skipped: more than " + std::to_string(most_exposures) +
                      " different exposures have come since");
  newest_.erase(oldest);
}

std::optional<double> LightStage::distance_to(const glm::dvec3& direction) const {
  if (settings_.sources.distance_m) return settings_.sources.distance_m;
  return room_ ? room_->distance(seen_from_, direction) : std::nullopt;
}

// Places a source at the distance that its lamp, the set or its room gives, as seen from
// seen_from_. The light of a lamp or an object that the set declares has its place there.
void LightStage::add_lamps(const lighting::Source& source, std::vector<set::Light>& lamps) const {
  const auto claim = static_cast<std::size_t>(source.claim);
  if (source.claim >= 0 && claim >= captured_lamps_.size()) return;
  const set::CapturedLamp* declared = source.claim < 0 ? nullptr : &captured_lamps_[claim];
  const auto distance_of = [&](const glm::dvec3& direction) {
    return declared && declared->position
               ? std::optional(glm::length(*declared->position - seen_from_))
               : distance_to(direction);
  };
  set::Light lamp = lighting::lamps_of({source}, seen_from_, distance_of).front();
  if (declared) {
    lamp.name = declared->name;
    lamp.captured = true;
    lamp.gain_mixed = declared->gain_mixed;
    lamp.tint = declared->tint;
  }
  lamps.push_back(std::move(lamp));
}

// Returns the source's flux where the light camera stands; a wall that is nearer there fills more
// of the view, at the same radiance.
glm::dvec3 LightStage::flux_at_camera(const lighting::Source& source) const {
  const auto distance = room_ ? room_->distance(seen_from_, source.direction) : std::nullopt;
  if (!distance) return source.flux;
  const glm::dvec3 point = seen_from_ + *distance * source.direction;
  const double nearer = *distance / glm::length(point - camera_place_);
  return source.flux * (nearer * nearer);
}

// Gives the set's measured lamps their emission, and notes what was taken out for each lamp.
void LightStage::measure_declared(Light& light) const {
  std::vector<glm::dvec3> fluxes(claimed_.claims.size());
  for (const lighting::Source& source : light.lighting.sources)
    if (source.claim >= 0) fluxes[static_cast<std::size_t>(source.claim)] += flux_at_camera(source);
  for (std::size_t c = 0; c < fluxes.size(); ++c) {
    const glm::dvec3& flux = fluxes[c];
    std::string note = fmt::format(
        "the light of \"{}\" is subtracted from the environment light: "
        "{:.3g} {:.3g} {:.3g} W/m^2 facing it",
        claimed_.claims[c].lamp, flux.r, flux.g, flux.b);
    const std::size_t index =
        c < captured_lamps_.size() ? no_light : claimed_.lights[c - captured_lamps_.size()];
    if (index != no_light) {
      const set::Light& lamp = lights_[index];
      const std::optional<glm::dvec3> emission = emission_for(lamp, flux, camera_place_);
      if (lamp.measured)
        light.emissions[lamp.name] = emission.value_or(glm::dvec3(0)) / lamp.gain_real;
      if (lamp.measured && !emission)
        note +=
            "; its brightness cannot be measured, because it faces away from the light "
            "camera; it stays dark until the set file gives its emission";
      else if (lamp.measured && flux == glm::dvec3(0))
        note +=
            "; no lamp is visible there; it stays dark until one is, or the set file gives its "
            "emission";
      else if (emission)
        note += fmt::format("; that is an emission of {:.3g} {:.3g} {:.3g}", emission->r,
                            emission->g, emission->b);
    }
    light.lighting.report.notes.push_back(std::move(note));
  }
}

LightPtr LightStage::placed(lighting::Lighting lighting, std::vector<std::uint64_t> sequences,
                            session::CapturedLight record,
                            std::shared_ptr<ImageLamps> image_lamps) const {
  Light light;
  light.camera_place = camera_place_;
  for (const lighting::Source& source : lighting.sources) add_lamps(source, light.lamps);
  light.encoded = render::encode_environment(lighting.environment);
  light.lighting = std::move(lighting);
  measure_declared(light);
  light.image_lamps = std::move(image_lamps);
  light.sequences = std::move(sequences);
  light.record = std::move(record);
  return std::make_shared<const Light>(std::move(light));
}

// A take always carries all sources, even if the picture is lit by the image, so that its light can
// be had again whatever the set declares.
LightPtr LightStage::finished(lighting::Lighting lighting, std::vector<std::uint64_t> sequences,
                              std::int64_t timestamp_ns) {
  std::vector<lighting::Source> declared =
      claims_.take_out(lighting.environment, settings_.sources);
  if (settings_.mode != set::LightMode::image) {
    lighting::apply_mode(lighting, settings_, tracker_, timestamp_ns, std::move(declared));
    for (lighting::Source& source : lighting.sources) source.region = -1;
    session::CapturedLight record = to_record(lighting);
    return placed(std::move(lighting), std::move(sequences), std::move(record), nullptr);
  }
  lighting::Lighting as_sources = lighting;
  set::Lighting settings = settings_;
  settings.mode = set::LightMode::hybrid;
  auto image_lamps = std::make_shared<ImageLamps>();
  image_lamps->texels =
      lighting::apply_mode(as_sources, settings, tracker_, timestamp_ns, declared);
  session::CapturedLight record = to_record(as_sources);
  for (const lighting::Source& source : as_sources.sources) {
    if (source.claim >= 0) {
      lighting.sources.push_back(source);
    } else {
      add_lamps(source, image_lamps->lamps);
      image_lamps->regions.push_back(source.region);
    }
  }
  image_lamps->without =
      std::make_shared<const lighting::EnvironmentMap>(std::move(as_sources.environment));
  return placed(std::move(lighting), std::move(sequences), std::move(record),
                std::move(image_lamps));
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
  turn(shot.scene.environment_turn_rad.value_or(0));
  if (settings_.from != set::LightFrom::recording) return light();
  if (!shot.recorded_light) return nullptr;
  // The light changes seldom; an unchanged one need not be put into the renderer again.
  if (!shown_ || *shown_ != *shot.recorded_light) {
    lighting::Lighting lighting = from_record(*shot.recorded_light);
    claims_.mark(lighting.sources);
    light_ = placed(std::move(lighting), {}, *shot.recorded_light, nullptr);
  }
  shown_ = shot.recorded_light;
  return light_;
}

}  // namespace previz::pipeline
