#include "daemon/core/render/device/pipeline_cache.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/report/log.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::render {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view prefix = "pipelines-";
constexpr std::size_t hash_digits = 64;

void note(const std::string& words) {
  report::log({report::Severity::info, "render", words});
}

std::string hash_of(std::string_view bytes) {
  session::Sha256 hash;
  hash.add(bytes);
  return hash.text();
}

// A driver says by its UUID which data it can read; the version makes the name of the file one that
// people can tell apart.
std::string name_of(const vk::PhysicalDeviceProperties& properties) {
  std::string uuid;
  for (const std::uint8_t byte : properties.pipelineCacheUUID) uuid += fmt::format("{:02x}", byte);
  return fmt::format("{}{:04x}-{:04x}-{:x}-{}", prefix, properties.vendorID, properties.deviceID,
                     properties.driverVersion, uuid);
}

// Returns what a driver wrote, behind whose hash it lies in the file; empty where there is nothing
// of use. Drivers check what they read only in part, and a damaged file can end the process.
std::string read_cache(const fs::path& file) {
  constexpr session::FileKind kind{"compiled shaders of previzd",
                                   PipelineCache::most_bytes + hash_digits};
  std::error_code none;
  if (!fs::exists(fs::symlink_status(file, none))) return {};
  const std::string text = session::read_plain_file(file, kind);
  const std::string_view data = std::string_view(text).substr(std::min(hash_digits, text.size()));
  if (text.size() < hash_digits || text.substr(0, hash_digits) != hash_of(data)) {
    note(file.string() + " is damaged; the shaders are compiled again");
    return {};
  }
  return std::string(data);
}

void remove_oldest(const fs::path& folder) {
  std::vector<std::pair<fs::file_time_type, fs::path>> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (entry.path().filename().string().starts_with(prefix) && entry.is_regular_file())
      files.emplace_back(entry.last_write_time(), entry.path());
  std::ranges::sort(files, std::greater());
  for (std::size_t i = PipelineCache::most_files; i < files.size(); ++i)
    fs::remove(files[i].second);
}

void write_cache(const fs::path& file, const std::vector<std::uint8_t>& data) try {
  const std::string_view bytes(reinterpret_cast<const char*>(data.data()), data.size());
  session::make_folders(file.parent_path());
  session::Draft draft(file);
  draft.file().append(hash_of(bytes));
  draft.file().append(bytes);
  draft.put(session::Sync::no);  // a power cut costs what the hash then shows to be damaged
  remove_oldest(file.parent_path());
} catch (const std::exception& error) {
  note(std::string("what was compiled cannot be kept for the next start: ") + error.what());
}

}  // namespace

fs::path cache_folder() {
  const auto variable = [](const char* name) -> fs::path {
    const char* value = std::getenv(name);
    return value && *value == '/' ? value : "";  // the specification ignores relative paths
  };
  if (const fs::path cache = variable("XDG_CACHE_HOME"); !cache.empty()) return cache / "previzd";
  if (const fs::path home = variable("HOME"); !home.empty()) return home / ".cache/previzd";
  return {};
}

PipelineCache::PipelineCache(const vk::raii::PhysicalDevice& physical,
                             const vk::raii::Device& device, const fs::path& folder) {
  std::string known;
  if (!folder.empty()) {
    file_ = folder / name_of(physical.getProperties());
    try {
      known = read_cache(file_);
    } catch (const Error& error) {
      note(std::string(error.what()) + "; the shaders are compiled again");
    }
  }
  cache_ =
      vk::raii::PipelineCache(device, vk::PipelineCacheCreateInfo({}, known.size(), known.data()));
}

PipelineCache::~PipelineCache() {
  finish();
}

void PipelineCache::finish() {
  if (saving_.valid()) saving_.wait();
}

bool PipelineCache::save() try {
  if (file_.empty()) return true;
  if (saving_.valid() && saving_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return false;
  std::vector<std::uint8_t> data = cache_.getData();
  if (data.size() > most_bytes) {
    note(fmt::format("{} bytes were compiled, more than are kept for the next start", data.size()));
    return true;
  }
  saving_ = std::async(std::launch::async,
                       [file = file_, data = std::move(data)] { write_cache(file, data); });
  return true;
} catch (const std::exception& error) {  // no memory, no thread, or no device any more
  note(std::string("what was compiled cannot be kept for the next start: ") + error.what());
  return true;
}

}  // namespace previz::render
