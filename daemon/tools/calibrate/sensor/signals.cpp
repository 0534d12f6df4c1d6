#include "daemon/tools/calibrate/sensor/signals.hpp"

#include "daemon/core/lighting/response.hpp"
#include "drivers/plate.hpp"

namespace previz::calibrate {

SignalPicture read_signals(const FramePtr& frame, const ResponseCurve& response) {
  const Plate plate = to_plate(*frame);
  const lighting::Response curve(response, plate.bits);
  SignalPicture picture{plate.width, plate.height, {}};
  picture.signal.reserve(plate.samples.size() / 3);
  for (std::size_t i = 0; i + 2 < plate.samples.size(); i += 3)
    picture.signal.emplace_back(curve.inverse()[plate.samples[i]],
                                curve.inverse()[plate.samples[i + 1]],
                                curve.inverse()[plate.samples[i + 2]]);
  return picture;
}

}  // namespace previz::calibrate
