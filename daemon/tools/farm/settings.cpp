#include "daemon/tools/farm/settings.hpp"

#include <nlohmann/json.hpp>

#include "daemon/tools/post/render_files.hpp"

namespace previz::farm {
namespace {

nlohmann::json without_range(const std::string& settings) {
  nlohmann::json json = nlohmann::json::parse(settings, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return nlohmann::json::object();
  json.erase("sample_range");
  return json;
}

}  // namespace

bool same_settings(const std::string& one, const std::string& other) {
  return without_range(one) == without_range(other);
}

std::string difference_words(const std::string& there, const std::string& planned) {
  return post::differences(without_range(there), without_range(planned));
}

bool is_merged_of(const Job& job, std::size_t merge, std::size_t sums) {
  const Chunk &whole = job.chunks.at(merge), &part = job.chunks.at(sums);
  return whole.kind == ChunkKind::merge && part.kind == ChunkKind::sums &&
         whole.take == part.take && whole.frames.first == part.frames.first;
}

}  // namespace previz::farm
