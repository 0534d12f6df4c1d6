// What the rig does, as files: the newest picture and the metrics.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "daemon/pipeline/channel.hpp"
#include "daemon/rig/notes.hpp"
#include "drivers/frame.hpp"

namespace previz::rig {

// For whoever looks on; a disk that does not take them is told, and no reason to stop.
class LiveFiles {
 public:
  // Makes the directory; throws previz::Error if it cannot. `metrics` gives metrics.json.
  LiveFiles(std::filesystem::path directory, std::function<std::string()> metrics, Notes& note);
  ~LiveFiles();  // writes the last ones
  LiveFiles(const LiveFiles&) = delete;
  LiveFiles& operator=(const LiveFiles&) = delete;

  // Written about once a second, on a thread that waits for the disk. Never waits.
  void take(std::shared_ptr<const Plate> picture) { pictures_.push(std::move(picture)); }

 private:
  void run();
  void write(const Plate* picture) const;

  const std::filesystem::path directory_;
  const std::function<std::string()> metrics_;
  Notes& note_;
  pipeline::Mailbox<std::shared_ptr<const Plate>> pictures_;
  std::jthread thread_;
};

}  // namespace previz::rig
