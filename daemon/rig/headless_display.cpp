#include "daemon/rig/headless_display.hpp"

#include <utility>

#include "daemon/output/png.hpp"
#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

namespace previz::rig {

HeadlessDisplay::HeadlessDisplay(std::filesystem::path directory, pipeline::Metrics& metrics)
    : directory_(std::move(directory)), metrics_(metrics) {
  std::error_code code;
  std::filesystem::create_directories(directory_, code);
  if (!std::filesystem::is_directory(directory_))
    throw Error(directory_.string() + ": cannot be made: " + code.message());
}

void HeadlessDisplay::show(pipeline::Shot shot) {
  const Clock::time_point now = Clock::now();
  const double in_device_s =
      1e-9 * static_cast<double>(shot.frame->arrival_ns - shot.frame->timestamp_ns);
  // A round of refining is no newer frame: it is as late as it was frozen long ago.
  if (!shot.frozen)
    metrics_.shown(std::chrono::duration<double>(now - shot.arrived).count() + in_device_s);
  picture_ = std::move(shot.picture);
  if (now - written_ < std::chrono::seconds(1)) return;
  write();
  written_ = Clock::now();
}

pipeline::MetricsSnapshot HeadlessDisplay::metrics() const {
  return metrics_.snapshot(std::chrono::duration<double>(Clock::now() - start_).count());
}

pipeline::MetricsSnapshot HeadlessDisplay::write() {
  if (!picture_.samples.empty()) output::write_png(directory_ / "picture.png", picture_);
  pipeline::MetricsSnapshot snapshot = metrics();
  session::replace_file(directory_ / "metrics.json", to_json(snapshot));
  return snapshot;
}

}  // namespace previz::rig
