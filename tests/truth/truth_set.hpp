// A ground truth set on disk (README.md, "Format of a set"): set.json and the files it names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"
#include "tests/truth/compare.hpp"

namespace previz::truth {

struct ObserverFrame {
  int index = 0;               // the set's own number; truth frames are named by it
  std::filesystem::path file;  // empty in a set without pictures
  std::int64_t timestamp_ns = 0;
  glm::dmat4 world_from_camera{1.0};
};

struct LightFrame {
  std::filesystem::path file;
  std::int64_t timestamp_ns = 0;
  double exposure = 1;  // absolute
};

struct TruthStatistics {
  std::optional<double> diff_rmse, mixed_rmse_of_mean;
};

// A real lamp that is changed in the mixed world: a disc in the environment.
struct RelitLamp {
  glm::dvec3 direction{0, 0, 1};  // unit, towards it
  double radius_rad = 0;
  glm::dvec3 gain_mixed{1};
};

struct TruthSet {
  std::string name;
  std::filesystem::path directory;
  ObserverCalibration observer;
  double exposure = 1;                // absolute, of every observer frame
  std::vector<ObserverFrame> frames;  // those whose picture is there, in order
  std::string tag_family;
  std::vector<set::Tag> tags;
  std::optional<LightCameraCalibration> light_camera;
  std::vector<LightFrame> light_frames;  // auto and brackets, by time; no sequence with other light
  std::filesystem::path environment, phantom, virtual_objects;
  std::vector<RelitLamp> relit;   // the truth has these changes
  std::vector<set::Light> lamps;  // real ones
  bool has_pictures = true;
  // Those whose truth and observer picture are there; in a set without pictures all.
  std::vector<int> truth_frames;
  std::map<int, TruthStatistics> statistics;
  std::vector<std::string> notes;  // what was left out and why, in plain words
};

// Throws previz::Error naming file and key, and what is allowed there.
TruthSet load_truth_set(const std::filesystem::path& directory);

// Reads the truth pictures and the plate of one frame. Throws previz::Error naming the file.
TruthFrame load_truth_frame(const TruthSet& set, int frame);

// Replaces the observer's pictures by what it would have taken with an exposure so many times as
// long: writes them into a directory and makes the set name them. Throws previz::Error naming the
// file.
void expose_longer(TruthSet& set, double times, const std::filesystem::path& directory);

// The objects and the true environment as a set, whose scene and light can be loaded.
set::Set set_of(const TruthSet& truth);

const ObserverFrame& observer_frame(const TruthSet& set, int frame);

// "0012"
std::string frame_name(int frame);

}  // namespace previz::truth
