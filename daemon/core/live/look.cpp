#include "daemon/core/live/look.hpp"

namespace previz::live {

Look first_look(const set::Set& set) {
  Look look;
  look.samples = set.quality.samples;
  look.governed = set.quality.fps > 0;
  look.accumulates = set.quality.accumulate;
  look.estimator = set.estimation.estimator;
  look.light_mode = set.lighting.mode;
  look.osd = set.display.osd;
  return look;
}

}  // namespace previz::live
