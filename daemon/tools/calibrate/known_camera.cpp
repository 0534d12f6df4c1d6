#include "daemon/tools/calibrate/known_camera.hpp"

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {

ResponseCurve response_of(const std::filesystem::path& footage, const std::string& stream) {
  session::SessionInfo info;
  if (is_session(footage)) info = session::open_session(footage).info;
  if (stream == "observer") return info.observer.value_or(ObserverCalibration{}).response;
  return info.light.value_or(LightCameraCalibration{}).response;
}

LightCameraCalibration light_sensor(const std::optional<std::filesystem::path>& set_file,
                                    const std::filesystem::path& footage) {
  if (set_file)
    if (const auto calibration = set::load_set(*set_file).light_camera.calibration)
      return *calibration;
  if (is_session(footage))
    if (const auto calibration = session::open_session(footage).info.light) return *calibration;
  return {};
}

ObserverCalibration known_observer(const std::optional<std::filesystem::path>& set_file,
                                   const std::filesystem::path& footage) {
  if (set_file)
    if (const auto calibration = set::load_set(*set_file).observer.calibration) return *calibration;
  if (is_session(footage))
    if (const auto calibration = session::open_session(footage).info.observer) return *calibration;
  throw Error(
      (set_file ? set_file->string() : footage.string()) +
      ": observer.intrinsics: the film camera has no lens calibration; give a set file with "
      "--set that has this table, as `previz calibrate observer` prints it");
}

LightCameraCalibration known_light_camera(const set::Set& set,
                                          const std::filesystem::path& footage) {
  session::SessionInfo info;
  if (is_session(footage)) info = session::open_session(footage).info;
  const auto calibration = pipeline::light_calibration(set, info);
  if (!calibration)
    throw Error(
        set.file.string() +
        ": light_camera.intrinsics: the light camera has no lens calibration; put this table "
        "in the set file, as `previz calibrate light --board` prints it");
  return *calibration;
}

}  // namespace previz::calibrate
