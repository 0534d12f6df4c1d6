// What the live picture is made with, frame by frame.
#pragma once

#include <cstdint>

#include "daemon/core/live/marking.hpp"
#include "daemon/core/live/mode.hpp"
#include "daemon/core/pipeline/edits.hpp"
#include "daemon/core/render/picture/views.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::live {

// Settings of the pipeline for the next frame. A Look is published as a whole and never changed.
struct Look {
  State state;
  int samples = 16;
  bool governed = false;     // quality.fps decides the samples until somebody asks for a number
  bool accumulates = false;  // averages over frames, live and in review
  set::Estimator estimator = set::Estimator::paired;
  set::LightMode light_mode = set::LightMode::image;
  render::View view = render::View::composite;
  bool osd = true;
  bool pass_times = false;     // on the overlay, while that is shown
  bool guides = false;         // lines over the picture, with or without the overlay
  pipeline::Edits edits;       // of the live picture
  pipeline::Edits take_edits;  // of the take in review, on top of what was recorded with it
  bool of_take = false;        // the picture is a take's: what is changed now are take_edits
  std::uint64_t plays = 0;     // restarts of the animations so far
  bool animations_held = false;
  int exposure_steps = 0;               // requested so far, up minus down
  std::uint64_t snapshots = 0;          // requested so far, of live pictures
  std::uint64_t refined_snapshots = 0;  // requested so far, of refined pictures
  std::uint64_t refinements = 0;        // begun so far
  Marking marking;
};

// Returns the look that a set begins with, of its keys alone.
Look first_look(const set::Set& set);

}  // namespace previz::live
