#include "daemon/core/pipeline/light_feed.hpp"

#include <utility>

namespace previz::pipeline {

void LightFeed::start(StageThreads& stages, Source source, Estimate estimate) {
  stages.source("light camera", frames_, std::move(source));
  stages.stage("lighting", frames_, lights_,
               [this, estimate = std::move(estimate)](LightFrame first) {
                 std::vector<LightFrame> waiting{std::move(first)};
                 while (std::optional<LightFrame> more = frames_.try_pop())
                   waiting.push_back(std::move(*more));
                 return estimate(std::move(waiting), views_.try_pop());
               });
}

LightPtr LightFeed::newest() {
  if (std::optional<LightPtr> newer = lights_.try_pop()) newest_ = std::move(*newer);
  return newest_;
}

}  // namespace previz::pipeline
