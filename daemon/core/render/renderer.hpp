// Renders the two worlds of a scene and composites them with the plate, progressively.
#pragma once

#include <functional>
#include <glm/mat4x4.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/render/frame_input.hpp"
#include "daemon/core/render/passes/showing.hpp"
#include "daemon/core/render/picture/layers.hpp"
#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/render/world/gpu_environment.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/card_picture.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::render {

// A frame with its samples, as Renderer::keep() returns it; nothing can change it.
struct KeptFrame;
using KeptFramePtr = std::shared_ptr<const KeptFrame>;

// Says where a picture is wanted.
struct ShowTo {
  bool computer = true;  // as a Plate
  bool card = false;     // in the card's memory; if it cannot be there, it comes down
};

class Renderer {
 public:
  Renderer(std::shared_ptr<Device> device, const set::Estimation& estimation,
           const ObserverCalibration& calibration);
  ~Renderer();

  // Makes a renderer as good as new for another set, but for what set_scene() can keep of its
  // scene.
  void begin_set(const set::Estimation& estimation, const ObserverCalibration& calibration);

  // Uploads the scene; may be called between any two frames (P13). Nothing is precomputed beyond
  // BVHs. Meshes, or textures, that are all equal to those of the scene before are kept as they
  // are, so that a scene in which only materials are different costs an upload of these.
  void set_scene(const scene::Scene& scene);
  // Moves the instances, gives them other looks (scene::Variants) and changes the lamps of the
  // scene last set. No mesh's BVH is rebuilt, and no pipeline is compiled for a look: the materials
  // of all variants are there, and so is what they require.
  void move(const std::vector<scene::Instance>& instances, const std::vector<set::Light>& lights);
  // Gives the meshes that deform their shapes, those of Scene::deformations in their order. Until
  // the first call after set_scene() they have those at rest.
  void deform(const std::vector<scene::Shape>& shapes);
  // use() and resize() take effect at the next begin(): another estimator, or another picture size
  // with its calibration. Scene and environment stay, and so do pipelines and buffers: only a
  // picture that is larger than all before it gets new buffers.
  void use(set::Estimator estimator);
  void resize(const ObserverCalibration& calibration);
  void set_environment(const lighting::EnvironmentMap& environment, set::LightSampling sampling);
  // Sets an environment that was encoded elsewhere, so that only the upload is left to do.
  void set_environment(const EncodedEnvironment& environment, set::LightSampling sampling);
  // Sets lamps beside those of the scene: the sources that were taken out of the environment. From
  // the first call on the pipelines are made for any number of them, even none, so that lamps can
  // come and go between frames without new pipelines.
  void set_sources(std::vector<set::Light> sources);

  // From the next begin() on, these features (FEATURE_* bits of rows of features() that can be
  // carried) are in the pipelines, needed or not, so that the savings of leaving them out can be
  // measured. No pixel depends on them.
  void carry(std::uint32_t features);
  // Returns the FEATURE_* bits that the current frame needs, without those that are only carried.
  std::uint32_t needed() const;

  // Starts a frame and clears what was accumulated.
  void begin(FrameInput frame);
  // Adds samples to every pixel of the current frame. The i-th sample of a pixel is the same
  // however the calls split them (P8). `cancelled` is asked between batches. A graphics card may
  // still be at work on some when it returns.
  void render(int samples, const std::function<bool()>& cancelled = {});
  // Waits until the samples so far are there, which render() need not do. Whatever asks for a
  // result waits by itself.
  void wait();
  // The sample that render() adds next is that of this index (from 0), so that a range of a frame's
  // samples can be rendered by itself. The current frame must have no samples yet, and the next
  // begin() starts at 0 again.
  void start_at(std::int64_t sample);
  // Returns the sums of the current frame's samples and forgets these; the sample that render()
  // adds next is the one after them. What was counted stays in counters(), so that the sums say
  // nothing of it. It takes 160 bytes of the computer's memory per pixel, 16 more with photons. Not
  // for a frame that accumulates.
  SampleSums take_sums();
  // Gives the current frame these samples, as if they had been rendered here: layers(), show() and
  // keep() are of them, and counters() include what the sums say. The frame must have no samples;
  // no more can be added. Throws previz::Error where the sums have another size than the
  // calibration, or have photons where the scene needs none, or the other way round.
  void put_sums(const SampleSums& sums);
  // Returns layers of separate samples, with other random numbers, which are then forgotten:
  // decisions based on them bias no picture. The current frame must have no samples yet. Returns
  // nothing if `cancelled` ended it.
  std::optional<Layers> pilot(int samples, const std::function<bool()>& cancelled = {});
  // From now on the pixels of each block of SAMPLED_BLOCK^2 (row-major) get no more than this many
  // samples: adaptive sampling, daemon/core/render/picture/error_estimate.hpp. begin() removes the
  // limits.
  void limit_samples(const std::vector<std::uint32_t>& limits);
  // The same with a limit for each of the SAMPLED_PARTS of each block, those of one block together:
  // the pixels that have one place in squares of 2x2, row-major.
  void limit_parts(const std::vector<std::uint32_t>& limits);
  // From now on the parts of a block have random numbers that are independent of one another, so
  // that one can judge how many samples another needs. Otherwise the pixels of a block share theirs
  // out (shaders/lib/sampler.glsl): if one has missed a light, others have met it more often. The
  // current frame must have no samples yet, and the next begin() ends it. Photons are still shared.
  void separate_parts();
  // Returns the layers of the samples so far.
  Layers layers() const;
  // Returns the current frame's plate at the size of its layers; valid until the next begin().
  const Plate& plate() const;
  // Returns the composite of the samples so far through exposure and response, as the display shows
  // it: the plate's own bits where nothing virtual touches it. If the frame accumulates, the
  // picture is the mean with those before; layers are always those of the frame alone. With
  // `denoise`, noise is taken out of it (daemon/core/render/passes/denoiser.hpp), and also out of
  // the composite of `layers`, which must be those of the same samples; their variance is then the
  // noise left. Throws previz::Error where the device has no memory for it.
  Plate show(bool denoise, Layers* layers = nullptr);
  // Does the same without layers, and does not wait for the picture: the next frame can be begun
  // meanwhile. The pictures of a renderer are to be finished in their order, and before it goes.
  Showing show_later(bool denoise, const ShowTo& to = {});
  // Returns what show_among() needs of the current frame, which must have a sample: its input, its
  // samples' sums, and how the scene stood. It takes 160 bytes of the computer's memory per pixel,
  // 16 more with photons, and the camera's frame, which it shares with FrameInput.
  KeptFramePtr keep() const;
  // Returns the picture of the last of these frames, averaged with the others as far as they show
  // the same: each is carried along to the next by the motion between the two, whichever was
  // earlier (order_of_neighbours() in daemon/core/render/picture/neighbours.hpp). Frames of
  // different numbers of samples have weights in proportion to these. Where the numbers differ
  // within a frame (limit_samples()), a pixel's weight is that of the largest one: the mean is as
  // true, but it is not the best one, and it may have more noise than with other weights.
  //
  // Without `denoise` a moving outline lags by a fraction of a pixel, and how much of a pixel it
  // covers is not as true as in the frame alone.
  //
  // The picture depends on these frames alone: not on the object, as long as it has the same
  // device, set, calibration and scene, nor on what it rendered before. A frame alone is what
  // show() makes of it if it does not accumulate. The samples should be independent: the frames
  // need seeds of their own, and should not be begun with FrameInput::accumulates, whose random
  // numbers depend on the frames before.
  //
  // `layers`, if it is not null, becomes that of the last frame's samples; with `denoise`,
  // composite, variance and mask in it are those of the picture.
  //
  // It ends what was accumulated, and the current frame: the next call is begin(). Instances,
  // lamps, sources and shapes are left as in the last frame; the environment stays as it was set.
  // Throws previz::Error where a frame has another size than the calibration, or the device has no
  // memory for it.
  Plate show_among(const std::vector<KeptFramePtr>& frames, bool denoise, Layers* layers = nullptr);
  // Returns what was counted since begin(). Waits for the samples, so that it costs least after
  // show().
  Counters counters() const;
  // Returns what names the device for displays that its pictures can be shown on without coming
  // down; nothing where they cannot.
  std::optional<CardIdentity> card() const;
  // Return what the device was given to do since it was opened, and how long its passes took since
  // the last call. Work of other renderers on the same device counts, too.
  DeviceWork work() const;
  DeviceTimes take_times();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::render
