// Iterates over the shots of a recorded take, each with its pose and its light.
#pragma once

#include <cstdint>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/core/pipeline/light_stage.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/pipeline/track_stage.hpp"
#include "daemon/core/report/report.hpp"
#include "drivers/camera.hpp"

namespace previz::pipeline {

struct TakeShotsOptions {
  // Observer frames by index in the stream, both ends included.
  std::uint64_t first = 0;
  std::uint64_t last = std::numeric_limits<std::uint64_t>::max();
  // Frames for which this returns false are left out. It is called once a frame, in order, when
  // all earlier shots have been handed out.
  std::function<bool(std::uint64_t index)> wanted = {};
  // It is called in the place of `wanted` for a frame that cannot be read, and after `note`.
  std::function<void(std::uint64_t index)> unreadable = {};
  // If this is false, frames that are left out are skipped even where tracking or lighting remember
  // earlier frames. That is quick, but then the light of a shot comes from its preceding light
  // frames alone.
  bool from_start = true;
  // At 1, shots come at the pace of the recording; at 0, as fast as they are asked for.
  double speed = 0;
  std::optional<set::Lighting> lighting = {};  // replaces the set's
  bool whole_light = false;             // no lamp of the set is taken out of the light around it
  const scene::Scene* scene = nullptr;  // as LightStage's
  // Receives what could not be read, found or used, in plain words.
  std::function<void(const std::string&)> note = {};
  Metrics* metrics = nullptr;  // counts work and troubles; may be null
  std::stop_token stop = {};   // ends the range
};

// This is a range that can be iterated once: for (Shot& shot : TakeShots(take, {.first = 3})) ...
//
// The shots are the ones that a pass through the whole take would give: where tracking or lighting
// remember earlier frames, frames that are left out are tracked and lit too. A shot without a pose
// or without light (no light frame precedes it) is in the range; a frame that cannot be read is
// not.
class TakeShots {
 public:
  // The take must outlive this. Throws previz::Error if the light has to come from light frames and
  // none were recorded, or if `first` lies after the take's end.
  explicit TakeShots(const Take& take, TakeShotsOptions options = {});

  // Returns the next shot, or nothing if there are no more.
  std::optional<Shot> next();

  class Iterator {
   public:
    using difference_type = std::ptrdiff_t;
    using value_type = Shot;

    explicit Iterator(TakeShots& shots) : shots_(&shots), shot_(shots.next()) {}
    Shot& operator*() { return *shot_; }
    Iterator& operator++() {
      shot_ = shots_->next();
      return *this;
    }
    void operator++(int) { ++*this; }
    friend bool operator==(const Iterator& at, std::default_sentinel_t) { return !at.shot_; }

   private:
    TakeShots* shots_;
    std::optional<Shot> shot_;
  };
  Iterator begin() { return Iterator(*this); }
  std::default_sentinel_t end() const { return {}; }

 private:
  void track(Shot& shot);
  void light(Shot& shot);
  void trouble(const std::string& words);
  void count_work(const char* stage, std::chrono::steady_clock::time_point begin);

  const TakeShotsOptions options_;
  TrackStage track_;
  LightStage light_;
  const std::shared_ptr<session::StreamReader> light_stream_;
  std::size_t next_light_ = 0;
  std::unique_ptr<Camera> camera_;
  bool goes_through_all_ = false;
  std::uint64_t next_ = 0;  // index of the frame that the camera gives next
  report::Once noted_;
};

}  // namespace previz::pipeline
