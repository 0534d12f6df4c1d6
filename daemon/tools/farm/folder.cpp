#include "daemon/tools/farm/folder.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <ctime>
#include <nlohmann/json.hpp>

#include "daemon/core/report/printable.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_numbers.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

constexpr std::array<const char*, 5> outcomes{"running", "done", "stopped", "machine", "job"};
// A job of a thousand takes takes less, and so does any state or reason.
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

// A machine's name comes from elsewhere, and is part of a file's.
std::string task_name(std::optional<std::uint64_t> number, const std::string& host) {
  if (number) return fmt::format("{:04}", *number);
  std::string name = "on-" + host;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '.') c = '_';
  return name;
}

JobFolder::JobFolder(const std::filesystem::path& folder)
    : path_(std::filesystem::absolute(folder).lexically_normal()) {
  if (!path_.has_filename()) path_ = path_.parent_path();  // "JOB/"
  std::error_code unknown;
  const std::filesystem::path real = std::filesystem::weakly_canonical(path_, unknown);
  if (!unknown) path_ = real;
}

std::filesystem::path JobFolder::sums(std::size_t take, int range) const {
  return path_ / "sums" / fmt::format("{:04}", take) / std::to_string(range);
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
  for (const char* name : {"log", "set", "set/with", "state", "sums"}) refuse(path_ / name);
  std::error_code unreadable;
  for (std::filesystem::recursive_directory_iterator entry(path_ / "sums", unreadable), end;
       !unreadable && entry != end; entry.increment(unreadable))
    if (entry.depth() < 2) refuse(entry->path());
}

std::optional<TaskState> JobFolder::read_state(const std::string& task) const {
  const std::filesystem::path file = path_ / "state" / (task + ".json");
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
    return state;
  } catch (const std::exception&) {
    return std::nullopt;  // written by hand, or on a disk that was full
  }
}

std::map<std::string, TaskState> JobFolder::read_states() const {
  std::map<std::string, TaskState> states;
  std::error_code gone;
  for (std::filesystem::directory_iterator entry(path_ / "state", gone), end; !gone && entry != end;
       entry.increment(gone)) {
    const std::filesystem::path& file = entry->path();
    if (file.extension() != ".json" || file.stem() == finish_name) continue;
    if (auto state = read_state(file.stem().string())) states[file.stem()] = *std::move(state);
  }
  return states;
}

void JobFolder::write_state(const std::string& task, const TaskState& state) const {
  session::replace_file(path_ / "state" / (task + ".json"),
                        text_of({{"outcome", name_of(state.outcome)},
                                 {"host", state.host},
                                 {"pid", state.pid},
                                 {"since", state.since},
                                 {"message", state.message}}));
}

void JobFolder::forget_states() const {
  std::error_code stays;
  for (const auto& [task, state] : read_states())
    std::filesystem::remove(path_ / "state" / (task + ".json"), stays);
  for (const std::filesystem::path& file :
       {path_ / "state" / (std::string(finish_name) + ".json"), stopped_file(), missing_file()})
    std::filesystem::remove(file, stays);
}

std::string JobFolder::read_stopped() const {
  return is_there(stopped_file()) ? session::read_plain_file(stopped_file(), state_kind) : "";
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
  options.frames = take.frames;
  options.directory = take.pictures;
  return options;
}

std::string JobFolder::name() const {
  session::Sha256 hash;
  hash.add(path_.string());
  return "previz-" + hash.text().substr(0, 8);
}

}  // namespace previz::farm
