#include "daemon/farm/farm.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <ostream>
#include <set>

#include "daemon/farm/finish.hpp"
#include "daemon/farm/machine.hpp"
#include "daemon/farm/plan.hpp"
#include "daemon/farm/scripts.hpp"
#include "daemon/farm/slurm.hpp"
#include "daemon/farm/status.hpp"
#include "daemon/farm/task.hpp"
#include "daemon/output/progress.hpp"
#include "drivers/error.hpp"
#include "drivers/session/draft.hpp"
#include "drivers/session/files.hpp"

namespace previz::farm {
namespace {

std::filesystem::path own_program() {
  std::error_code code;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", code);
  return code ? std::filesystem::path("previzd") : program;
}

// Returns the folder of a job that the command line does not name: "renders/12A.farm".
JobFolder folder_for(const FarmOptions& options, const Job& job) {
  if (options.job) return JobFolder(*options.job);
  std::filesystem::path folder = job.takes.front().pictures;
  if (!folder.has_filename()) folder = folder.parent_path();
  folder += ".farm";
  return JobFolder(folder);
}

ScriptPlaces places_of(const JobFolder& folder, const Job& job,
                       const std::filesystem::path& program) {
  const auto lies_elsewhere = [&](const JobTake& take) {
    return !session::lies_within(folder.path().parent_path(), take.pictures);
  };
  return {program.empty() ? own_program() : program, folder.path(),
          job.render.any_paths || std::ranges::any_of(job.takes, lies_elsewhere)};
}

std::uint64_t frames_of(const Job& job) {
  std::uint64_t frames = 0;
  for (const JobTake& take : job.takes) frames += take.frames.last - take.frames.first + 1;
  return frames;
}

void print_plan(const Job& job, const JobFolder& folder, std::ostream& out) {
  out << folder.path().string() << ": " << frames_of(job) << " frames of " << job.takes.size()
      << (job.takes.size() == 1 ? " take" : " takes") << " in " << job.first_merge() << " tasks";
  if (job.sample_ranges > 1)
    out << ", each frame in " << job.sample_ranges << " sample ranges, and "
        << job.chunks.size() - job.first_merge() << " tasks that merge them";
  out << ", on "
      << (job.any_device ? "whatever device there is"
          : job.on_gpu   ? "a graphics card each"
                         : "processors (--gpu asks for graphics cards)")
      << std::endl;
}

// Frames that were rendered before with the same settings are not rendered again.
std::set<std::size_t> chunks_to_do(const JobFolder& folder, const Job& job, std::ostream& out,
                                   const std::stop_token& stop) {
  return prove(folder, job, out, stop).chunks;
}

void refuse_while_queued(const JobStatus& status, const JobFolder& folder) {
  if (!status.is_queued && status.running == 0) return;
  throw Error(folder.path().string() +
              ": tasks are still running or waiting; wait for them (`previzd farm status`), or "
              "cancel them first (`previzd farm cancel`)");
}

std::string bar(double share) {
  constexpr int width = 32;
  const int full = static_cast<int>(share * width);
  return "[" + std::string(static_cast<std::size_t>(full), '#') +
         std::string(static_cast<std::size_t>(width - full), '-') + "]";
}

void print_task(const Job& job, std::size_t chunk, const ChunkStatus& status, std::ostream& out) {
  out << "task " << chunk << ", " << words_of(job, job.chunks[chunk]) << ": ";
  if (status.is_running)
    out << "running on " << (status.state ? status.state->host : "a machine that says nothing")
        << ", " << status.done << " of " << status.frames << " frames done";
  else if (status.state && !status.state->message.empty())
    out << (status.queue.empty() ? "" : "waiting again; ") << status.state->host << ": "
        << status.state->message;
  else if (status.state)
    out << "ended on " << status.state->host << " with " << status.done << " of " << status.frames
        << " frames done";
  out << std::endl;
}

void print_words(const JobFolder& folder, const Job& job, const JobStatus& status, bool terminal,
                 std::ostream& out) {
  const auto failed = std::ranges::count_if(status.chunks, &ChunkStatus::has_failed);
  const double share =
      status.frames > 0 ? static_cast<double>(status.done) / static_cast<double>(status.frames) : 1;
  if (terminal) out << bar(share) << " ";
  out << status.done << " of " << status.frames << " frames done, " << status.running
      << (status.running == 1 ? " task" : " tasks") << " running, " << failed << " failed";
  if (const std::optional<double> left = status.seconds_left())
    out << ", about " << output::duration_words(*left) << " left";
  else if (status.done < status.frames)
    out << (status.is_queued ? ", waiting in the queue" : "");
  out << std::endl;
  if (!status.stopped.empty()) out << "stopped: " << status.stopped;
  for (std::size_t i = 0; i < status.chunks.size(); ++i)
    if (status.chunks[i].is_running || status.chunks[i].has_failed())
      print_task(job, i, status.chunks[i], out);
  if (status.done < status.frames && !status.is_queued && status.running == 0)
    out << "nothing runs: `previzd farm retry` renders what is missing" << std::endl;
  std::error_code unknown;
  if (status.done == status.frames &&
      !std::filesystem::exists(folder.place("chunks/0000"), unknown))
    for (const JobTake& take : job.takes)
      out << "pictures: " << take.pictures.string() << std::endl;
}

void print_json(const Job& job, const JobStatus& status, std::ostream& out) {
  nlohmann::ordered_json json{{"frames", status.frames},
                              {"done", status.done},
                              {"running", status.running},
                              {"is_queued", status.is_queued},
                              {"stopped", status.stopped}};
  if (const std::optional<double> left = status.seconds_left()) json["seconds_left"] = *left;
  json["tasks"] = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < status.chunks.size(); ++i) {
    const ChunkStatus& chunk = status.chunks[i];
    nlohmann::ordered_json one{{"task", i},
                               {"about", words_of(job, job.chunks[i])},
                               {"frames", chunk.frames},
                               {"done", chunk.done},
                               {"running", chunk.is_running},
                               {"failed", chunk.has_failed()}};
    if (!chunk.queue.empty()) one["queue"] = chunk.queue;
    if (chunk.state) {
      one["outcome"] = name_of(chunk.state->outcome);
      one["host"] = chunk.state->host;
      one["message"] = chunk.state->message;
    }
    json["tasks"].push_back(std::move(one));
  }
  out << json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
}

}  // namespace

void submit(const FarmOptions& options, std::ostream& out) {
  const Job job = make_job(options);
  const JobFolder folder = folder_for(options, job);
  const ScriptPlaces places = places_of(folder, job, options.program);
  print_plan(job, folder, out);
  if (options.dry_run) {
    if (options.openjd)
      out << openjd_template(places, job, folder.name());
    else
      print_submission(folder, job, places, options.sbatch, out);
    return;
  }
  const bool uses_slurm = !options.openjd && has_slurm();
  make_folder(options, folder, job);
  write_scripts(folder, job, places);
  const std::set<std::size_t> to_do = chunks_to_do(folder, job, out, options.stop);
  if (options.openjd)
    session::replace_file(*options.openjd, openjd_template(places, job, folder.name()));
  if (to_do.empty()) {
    out << "all of these frames are rendered already, with these settings" << std::endl;
    return;
  }
  if (uses_slurm)
    submit_chunks(folder, job, to_do, options.sbatch, out);
  else if (options.openjd)
    out << options.openjd->string() << ": submit it to a scheduler that takes Open Job Descriptions"
        << std::endl;
  else
    out << "There is no Slurm here (no program sbatch). Start this on each machine:\n  bash "
        << shell_word(folder.loop_script().string()) << std::endl;
}

void print_status(const JobOptions& options, std::ostream& out) {
  const JobFolder folder(options.job);
  const Job job = folder.read_plan();
  const JobStatus status = status_of(folder, job);
  if (options.json)
    print_json(job, status, out);
  else
    print_words(folder, job, status, options.terminal, out);
}

void cancel(const JobOptions& options, std::ostream& out) {
  const JobFolder folder(options.job);
  static_cast<void>(folder.read_plan());
  cancel_tasks(folder);
  out << folder.path().string()
      << ": canceled; what is finished stays, and `previzd farm retry` goes on" << std::endl;
}

void retry(const JobOptions& options, std::ostream& out) {
  const JobFolder folder(options.job);
  const Job job = folder.read_plan();
  check_paths(folder, job, options.any_paths);
  refuse_while_queued(status_of(folder, job), folder);
  std::error_code stays;
  std::filesystem::remove(folder.stopped_file(), stays);
  const JobLock lock(folder, options.stop);
  const Proof proof = prove(folder, job, out, options.stop);
  write_missing(folder, job, proof);
  print_missing(folder, job, proof, out);
  const ScriptPlaces places = places_of(folder, job, options.program);
  write_scripts(folder, job, places);
  if (proof.missing.empty()) {
    complete(folder, job, out);
    out << folder.path().string() << ": every frame is there and whole" << std::endl;
  } else if (has_slurm()) {
    submit_chunks(folder, job, proof.chunks, options.sbatch, out);
  } else {
    out << "start this on each machine:\n  bash " << shell_word(folder.loop_script().string())
        << std::endl;
  }
}

int finish(const JobOptions& options, std::ostream& out) {
  const JobFolder folder(options.job);
  const Job job = folder.read_plan();
  check_paths(folder, job, options.any_paths);
  const Machine machine = this_machine();
  TaskState state = state_now(TaskOutcome::running, machine.host, "");
  try {
    folder.write_finish_state(state);
    const int status = run_finish(folder, job, out, options.stop);
    folder.write_finish_state(
        state_now(status == task_status::done ? TaskOutcome::done : TaskOutcome::machine,
                  machine.host, status == task_status::done ? "" : "frames are missing"));
    return status;
  } catch (const JobFault&) {
    throw;
  } catch (const Error& error) {
    out << error.what() << std::endl;
    try {
      folder.write_finish_state(state_now(TaskOutcome::machine, machine.host, error.what()));
    } catch (const Error& full) {
      out << full.what() << std::endl;
    }
    return task_status::machine_fault;
  }
}

}  // namespace previz::farm
