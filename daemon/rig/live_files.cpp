#include "daemon/rig/live_files.hpp"

#include <chrono>
#include <cstdlib>

#include "daemon/core/output/png.hpp"
#include "daemon/core/session/draft.hpp"
#include "drivers/error.hpp"

namespace previz::rig {

std::filesystem::path live_directory(const std::filesystem::path& otherwise) {
  const char* runtime = std::getenv("RUNTIME_DIRECTORY");
  return runtime && *runtime ? std::filesystem::path(runtime) : otherwise;
}

LiveFiles::LiveFiles(std::filesystem::path directory, std::function<std::string()> metrics,
                     report::Reports& reports)
    : directory_(std::move(directory)), metrics_(std::move(metrics)), reports_(reports) {
  std::error_code code;
  std::filesystem::create_directories(directory_, code);
  if (!std::filesystem::is_directory(directory_))
    throw Error(directory_.string() + ": cannot be created: " + code.message());
  thread_ = std::jthread([this] { run(); });
}

LiveFiles::~LiveFiles() {
  pictures_.close();
}

void LiveFiles::run() {
  std::shared_ptr<const Plate> newest;
  while (std::optional<std::shared_ptr<const Plate>> picture = pictures_.pop()) {
    newest = *std::move(picture);
    if (!is_due()) continue;
    written_ = std::chrono::steady_clock::now();
    write(newest.get());
  }
  write(newest.get());
}

bool LiveFiles::is_due() const {
  return std::chrono::steady_clock::now() - written_.load() >= std::chrono::seconds(1);
}

void LiveFiles::write(const Plate* picture) const {
  try {
    // The next second replaces them, so that no disk is made to keep them.
    using session::Sync;
    if (picture) output::write_png(directory_ / "picture.png", *picture, Sync::no);
    session::Draft metrics(directory_ / "metrics.json");
    metrics.file().append(metrics_());
    metrics.put(Sync::no);
  } catch (const std::exception& error) {
    reports_(report::once({report::Severity::error, "", error.what()}));
  }
}

}  // namespace previz::rig
