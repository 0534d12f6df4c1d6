// Writes the newest picture and the metrics to files that other programs can watch.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/report/reports.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::rig {

// Returns the folder that systemd makes for a service in memory (RuntimeDirectory=), because a disk
// would wear out by a picture each second; `otherwise` for a program that is no service.
std::filesystem::path live_directory(const std::filesystem::path& otherwise);

// A disk that does not take the files is reported but is no reason to stop.
class LiveFiles {
 public:
  // Makes the directory; throws previz::Error if it cannot. `metrics` returns the text of
  // metrics.json.
  LiveFiles(std::filesystem::path directory, std::function<std::string()> metrics,
            report::Reports& reports);
  ~LiveFiles();  // writes the last picture that was taken, and metrics
  LiveFiles(const LiveFiles&) = delete;
  LiveFiles& operator=(const LiveFiles&) = delete;

  // Returns at once; a thread that waits for the disk writes the newest about once a second.
  void take(std::shared_ptr<const Plate> picture) { pictures_.push(std::move(picture)); }
  // Returns whether it would write a picture that is taken now. May be called from any thread.
  bool is_due() const;

 private:
  void run();
  void write(const Plate* picture) const;

  const std::filesystem::path directory_;
  const std::function<std::string()> metrics_;
  report::Reports& reports_;
  pipeline::Mailbox<std::shared_ptr<const Plate>> pictures_;
  std::atomic<std::chrono::steady_clock::time_point> written_;  // when the last picture was
  std::jthread thread_;
};

}  // namespace previz::rig
