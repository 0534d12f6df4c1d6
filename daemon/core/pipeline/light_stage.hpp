// The lighting stage turns light frames into the newest estimate of the light (P9, P11).
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/lighting/source_tracker.hpp"
#include "daemon/core/pipeline/lamp_claims.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::pipeline {

// Keeps the newest light frame of every exposure seen so far; together they are the bracket that is
// merged. (Two exposures within 1 % count as the same; where an automatic exposure wanders, the
// newest most_exposures stay.) A set whose light does not come from a camera needs no light frames.
class LightStage {
 public:
  // Loads the environment if the set gives one, and the room if it has one. The light of lamps that
  // the set declares, and of real objects of `scene` that glow, is taken out of it (claims_of);
  // without a scene, objects do not count. Throws previz::Error if the light camera's calibration
  // is needed but not known.
  LightStage(const set::Set& set, std::optional<LightCameraCalibration> calibration,
             const ObserverCalibration& observer, const scene::Scene* scene = nullptr);

  // True if the light is made from light frames.
  bool needs_frames() const { return estimator_.has_value(); }
  // True if the film camera's pictures fill in what the light camera cannot see.
  bool needs_observer() const { return observed_ != nullptr; }
  // True if the light depends on more than the newest bracket, so that the light of a frame in the
  // middle of a take needs all the frames before it.
  bool remembers() const;

  // Holds the first light back until a whole bracket of so many different exposures was seen, or
  // twice as many frames, since exposures may get lost or come out alike. Without this call the
  // first frame gives the first light.
  void await_bracket(std::size_t exposures);

  // Sets how the light is taken from the frames, from the next light() on.
  void use(set::LightMode mode);

  // Takes a light frame; frames come in capture order. `index` is the frame's place in its stream,
  // from 0, and matters only if the set names the one frame to use (lighting.frame). A frame that
  // cannot be used (another size than the calibration's, no exposure) is left out, the light stays
  // as it was, and troubles() says so.
  void see(FramePtr frame, std::uint64_t index);
  // Takes a picture of the film camera, with the exposure that its frame states.
  void see_observer(const Plate& plate, double exposure, const glm::dmat4& world_from_camera);

  // Returns the light from the frames so far, computed only if there are new ones; null if no frame
  // was usable yet.
  LightPtr light();
  // Returns the same for a tracked observer frame; with lighting.from = "recording", the light that
  // was recorded with the frame, or null if there is none.
  LightPtr light_for(const Shot& shot);

  // Returns what was left out since the last call, in plain words.
  std::vector<std::string> troubles() { return std::exchange(troubles_, {}); }

 private:
  bool given() const;
  void show_given();
  void turn(double turn_rad);
  void claim_lamps(const set::Set& set, const scene::Scene* scene, int map_size);
  LightPtr finished(lighting::Lighting lighting, std::vector<std::uint64_t> sequences,
                    std::int64_t timestamp_ns);
  LightPtr placed(lighting::Lighting lighting, std::vector<std::uint64_t> sequences,
                  session::CapturedLight record, std::shared_ptr<ImageLamps> image_lamps) const;
  std::optional<double> distance_to(const glm::dvec3& direction) const;
  void add_lamps(const lighting::Source& source, std::vector<set::Light>& lamps) const;
  void measure_declared(Light& light) const;
  glm::dvec3 flux_at_camera(const lighting::Source& source) const;
  bool usable(const Frame& frame);
  void drop_oldest();
  bool awaits_bracket() const { return newest_.size() < awaited_ && seen_ < 2 * awaited_; }

  set::Lighting settings_;
  const std::vector<set::CapturedLamp> captured_lamps_;
  const std::vector<set::Light> lights_;           // the set's
  const std::optional<double> exposure_;           // overrides the light frames' own
  const std::optional<double> observer_exposure_;  // overrides the observer frames' own
  std::optional<lighting::Estimator> estimator_;   // absent: the light needs no frames
  lighting::Lighting given_;                       // from the set file
  double turned_rad_ = 0;                          // by the crew, in settings_ and given_
  FisheyeIntrinsics intrinsics_;                   // the light camera's
  std::shared_ptr<const lighting::Room> room_;
  glm::dvec3 seen_from_{0};     // where the image is seen from; world, metres
  glm::dvec3 camera_place_{0};  // where the light camera stands; world, metres
  LampClaims claimed_;
  lighting::Claims claims_;
  std::unique_ptr<lighting::ObservedLight> observed_;
  std::map<long, FramePtr> newest_;  // key: exposure in steps of 1 %
  std::size_t awaited_ = 1;          // exposures of the first bracket
  std::size_t seen_ = 0;             // number of light frames
  std::vector<std::string> troubles_;
  std::shared_ptr<const session::CapturedLight> shown_;  // source of light_, if recorded
  bool changed_ = false;
  lighting::SourceTracker tracker_;
  LightPtr light_;
};

}  // namespace previz::pipeline
