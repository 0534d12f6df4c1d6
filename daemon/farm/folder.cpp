#include "daemon/farm/folder.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "drivers/error.hpp"
#include "drivers/session/draft.hpp"
#include "drivers/session/files.hpp"

namespace previz::farm {
namespace {

constexpr std::array<const char*, 5> outcomes{"running", "done", "stopped", "machine", "job"};
// What a job of a million chunks takes, and more than any that is not made to fill the memory.
constexpr std::uintmax_t most_bytes = std::uintmax_t{1} << 28;

bool is_there(const std::filesystem::path& file) {
  std::error_code unknown;
  return std::filesystem::exists(std::filesystem::symlink_status(file, unknown));
}

std::string read_small(const std::filesystem::path& file) {
  std::error_code unknown;
  const std::uintmax_t bytes = std::filesystem::file_size(file, unknown);
  if (!unknown && bytes > most_bytes) throw Error(file.string() + ": is too large for such a file");
  return session::read_plain_file(file);
}

std::string text_of(const nlohmann::ordered_json& json) {
  return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace

const char* name_of(TaskOutcome outcome) {
  return outcomes.at(static_cast<std::size_t>(outcome));
}

JobFolder::JobFolder(std::filesystem::path folder)
    : path_(std::filesystem::absolute(folder).lexically_normal()) {
  if (!path_.has_filename()) path_ = path_.parent_path();  // "JOB/"
}

std::filesystem::path JobFolder::chunk(std::size_t chunk) const {
  return path_ / "chunks" / chunk_number(chunk);
}

std::filesystem::path JobFolder::state_file(std::size_t chunk) const {
  return path_ / "state" / (chunk_number(chunk) + ".json");
}

Job JobFolder::read_plan() const {
  if (!is_there(plan()))
    throw Error(path_.string() +
                ": holds no job (no job.json); give the folder that "
                "`previzd farm` named when it submitted the job");
  return job_from_json(read_small(plan()), plan().string());
}

std::optional<TaskState> JobFolder::read_state(std::size_t chunk) const {
  const std::filesystem::path file = state_file(chunk);
  if (!is_there(file)) return std::nullopt;
  try {
    const auto json = nlohmann::json::parse(read_small(file));
    TaskState state;
    const auto outcome = std::ranges::find(outcomes, json.at("outcome").get<std::string_view>());
    if (outcome == outcomes.end()) return std::nullopt;
    state.outcome = static_cast<TaskOutcome>(outcome - outcomes.begin());
    json.at("host").get_to(state.host);
    json.at("pid").get_to(state.pid);
    json.at("since").get_to(state.since);
    json.at("message").get_to(state.message);
    return state;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;  // written by hand, or on a disk that was full
  }
}

void JobFolder::write_state(std::size_t chunk, const TaskState& state) const {
  const nlohmann::ordered_json json{{"outcome", name_of(state.outcome)},
                                    {"host", state.host},
                                    {"pid", state.pid},
                                    {"since", state.since},
                                    {"message", state.message}};
  session::replace_file(state_file(chunk), text_of(json));
}

Submitted JobFolder::read_submitted() const {
  const std::filesystem::path file = path_ / "submitted.json";
  if (!is_there(file)) return {};
  try {
    const auto json = nlohmann::json::parse(read_small(file));
    Submitted submitted;
    json.at("tasks").get_to(submitted.tasks);
    if (json.contains("finish")) submitted.finish = json.at("finish").get<std::uint64_t>();
    return submitted;
  } catch (const nlohmann::json::exception& error) {
    throw Error(file.string() + ": cannot be understood: " + error.what());
  }
}

void JobFolder::write_submitted(const Submitted& submitted) const {
  nlohmann::ordered_json json{{"tasks", submitted.tasks}};
  if (submitted.finish) json["finish"] = *submitted.finish;
  session::replace_file(path_ / "submitted.json", text_of(json));
}

std::string JobFolder::read_stopped() const {
  return is_there(stopped_file()) ? read_small(stopped_file()) : "";
}

post::RenderOptions JobFolder::render_options(const Job& job, const JobTake& take) const {
  post::RenderOptions options = job.render;
  options.session = take.session;
  if (!job.set_file.empty()) options.set_file = place(job.set_file);
  if (!job.with_file.empty()) options.with = place(job.with_file);
  for (const auto& [name, in_folder] : job.set_assets)
    options.set_assets.emplace_back(name, place(in_folder));
  options.exr = take.exr;
  options.png = take.png;
  options.video = take.video;
  return options;
}

std::string JobFolder::name() const {
  session::Sha256 hash;
  hash.add(path_.string());
  return "previz-" + hash.text().substr(0, 8);
}

}  // namespace previz::farm
