#include "daemon/rig/live_files.hpp"

#include <utility>

#include "daemon/output/png.hpp"
#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

namespace previz::rig {

LiveFiles::LiveFiles(std::filesystem::path directory, const pipeline::Metrics& metrics)
    : directory_(std::move(directory)), metrics_(metrics) {
  std::error_code code;
  std::filesystem::create_directories(directory_, code);
  if (!std::filesystem::is_directory(directory_))
    throw Error(directory_.string() + ": cannot be made: " + code.message());
}

void LiveFiles::take(std::shared_ptr<const Plate> picture) {
  picture_ = std::move(picture);
  if (Clock::now() - written_ < std::chrono::seconds(1)) return;
  write();
  written_ = Clock::now();
}

pipeline::MetricsSnapshot LiveFiles::metrics() const {
  return metrics_.snapshot(std::chrono::duration<double>(Clock::now() - start_).count());
}

pipeline::MetricsSnapshot LiveFiles::write() {
  if (picture_) output::write_png(directory_ / "picture.png", *picture_);
  pipeline::MetricsSnapshot snapshot = metrics();
  session::replace_file(directory_ / "metrics.json", to_json(snapshot));
  return snapshot;
}

}  // namespace previz::rig
