#include "daemon/tools/farm/folder.hpp"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <nlohmann/json.hpp>

#include "daemon/core/report/printable.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_numbers.hpp"
#include "daemon/tools/farm/signs_of_life.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

constexpr std::array<const char*, 5> outcomes{"running", "done", "stopped", "machine", "job"};
// A job of a million chunks takes less, and so does any state or reason.
constexpr session::FileKind plan_kind{"a job's plan", 1 << 27},
    state_kind{"a state of a job", 1 << 16};

bool is_there(const std::filesystem::path& file) {
  std::error_code unknown;
  return std::filesystem::exists(std::filesystem::symlink_status(file, unknown));
}

// Returns whether the folder can be looked into, so that what is not found in it is not there.
bool can_be_entered(const std::filesystem::path& folder) {
  return ::access(folder.c_str(), R_OK | X_OK) == 0;
}

std::string text_of(const nlohmann::ordered_json& json) {
  return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace

const char* name_of(TaskOutcome outcome) {
  return outcomes.at(static_cast<std::size_t>(outcome));
}

TaskState state_now(TaskOutcome outcome, const std::string& host, const std::string& message) {
  return {outcome, host, ::getpid(),
          fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::time(nullptr))),
          on_one_line(message)};
}

JobFolder::JobFolder(const std::filesystem::path& folder) : JobFolder(folder, post::call_fcntl) {}

JobFolder::JobFolder(const std::filesystem::path& folder, LockCall call)
    : call_(call), path_(std::filesystem::absolute(folder).lexically_normal()) {
  if (!path_.has_filename()) path_ = path_.parent_path();  // "JOB/"
  std::error_code unknown;
  const std::filesystem::path real = std::filesystem::weakly_canonical(path_, unknown);
  if (!unknown) path_ = real;
}

std::filesystem::path JobFolder::chunk(std::size_t chunk) const {
  return path_ / "chunks" / chunk_number(chunk);
}

std::filesystem::path JobFolder::state_file(std::size_t chunk) const {
  return path_ / "state" / (chunk_number(chunk) + ".json");
}

Job JobFolder::read_plan() const {
  struct stat found {};
  if (::stat(plan().c_str(), &found) != 0 && errno == ENOENT && can_be_entered(path_))
    throw JobFault(path_.string() +
                   ": holds no job (no job.json); give the folder that `previz farm` named when "
                   "it submitted the job");
  if (const std::string why = session::why_not_plain(plan()); !why.empty())
    throw JobFault(plan().string() + ": " + why);
  refuse_links();
  return job_from_json(session::read_plain_file(plan(), plan_kind), plan().string());
}

// A job's folder may come from elsewhere, and what is written and removed below it must be in it.
void JobFolder::refuse_links() const {
  const auto refuse = [](const std::filesystem::path& folder) {
    std::error_code unknown;
    const auto kind = std::filesystem::symlink_status(folder, unknown).type();
    if (kind != std::filesystem::file_type::directory &&
        kind != std::filesystem::file_type::not_found && kind != std::filesystem::file_type::none)
      throw JobFault(folder.string() +
                     ": is a link, or no folder, by which files would be written elsewhere; "
                     "remove it, or make the job again");
  };
  for (const char* name : {"chunks", "log", "set", "set/with", "state"}) refuse(path_ / name);
  std::error_code unreadable;
  for (const auto& entry : std::filesystem::directory_iterator(path_ / "chunks", unreadable))
    refuse(entry.path());
}

std::optional<TaskState> JobFolder::read_state(std::size_t chunk) const {
  return read_state_in(state_file(chunk));
}

void JobFolder::write_state(std::size_t chunk, const TaskState& state) const {
  write_state_in(state_file(chunk), state);
}

std::optional<TaskState> JobFolder::read_finish_state() const {
  return read_state_in(finish_state_file());
}

void JobFolder::write_finish_state(const TaskState& state) const {
  write_state_in(finish_state_file(), state);
}

std::optional<TaskState> JobFolder::read_state_in(const std::filesystem::path& file) const {
  if (!is_there(file)) return std::nullopt;
  try {
    const auto json = nlohmann::json::parse(session::read_plain_file(file, state_kind));
    TaskState state;
    const auto outcome = std::ranges::find(outcomes, json.at("outcome").get<std::string_view>());
    if (outcome == outcomes.end()) return std::nullopt;
    state.outcome = static_cast<TaskOutcome>(outcome - outcomes.begin());
    json.at("host").get_to(state.host);
    state.pid = session::number_at<std::int64_t>(json, "pid");
    json.at("since").get_to(state.since);
    json.at("message").get_to(state.message);
    state.alone = json.value("alone", false);
    return state;
  } catch (const Error&) {
    throw;
  } catch (const std::exception&) {
    return std::nullopt;  // written by hand, or on a disk that was full
  }
}

void JobFolder::write_state_in(const std::filesystem::path& file, const TaskState& state) const {
  nlohmann::ordered_json json{{"outcome", name_of(state.outcome)},
                              {"host", state.host},
                              {"pid", state.pid},
                              {"since", state.since},
                              {"message", state.message}};
  if (!has_locks()) json["alone"] = true;
  session::replace_file(file, text_of(json));
}

void JobFolder::remove_finish_state() const {
  std::error_code stays;
  std::filesystem::remove(finish_state_file(), stays);
}

Submitted JobFolder::read_submitted() const {
  const std::filesystem::path file = path_ / "submitted.json";
  if (!is_there(file)) return {};
  try {
    const auto json = nlohmann::json::parse(session::read_plain_file(file, state_kind));
    Submitted submitted;
    submitted.tasks = session::numbers_of<std::uint64_t>(json.at("tasks"));
    if (json.contains("finish"))
      submitted.finish = session::number_at<std::uint64_t>(json, "finish");
    return submitted;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(file.string() + ": cannot be understood: " + error.what());
  }
}

void JobFolder::write_submitted(const Submitted& submitted) const {
  nlohmann::ordered_json json{{"tasks", submitted.tasks}};
  if (submitted.finish) json["finish"] = *submitted.finish;
  session::replace_file(path_ / "submitted.json", text_of(json));
}

std::string JobFolder::read_stopped() const {
  return is_there(stopped_file()) ? session::read_plain_file(stopped_file(), state_kind) : "";
}

bool JobFolder::has_locks() const {
  const OwnedDescriptor file(
      ::open(plan().c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  return !file || post::why_others_are_not_seen(file.get(), path_, call_).empty();
}

std::optional<TaskState> JobFolder::living(const std::filesystem::path& state_file) const {
  std::optional<TaskState> state = read_state_in(state_file);
  const bool is_alive = state && state->outcome == TaskOutcome::running &&
                        (state->alone || !has_locks()) && has_signs_of_life(state_file);
  return is_alive ? state : std::nullopt;
}

std::optional<TaskState> JobFolder::living_finish() const {
  return living(finish_state_file());
}

Taken JobFolder::taken(std::size_t chunk) const {
  if (post::is_in_use(this->chunk(chunk), call_)) return Taken::shared;
  return living(state_file(chunk)) ? Taken::alone : Taken::no;
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
