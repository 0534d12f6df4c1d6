#include "daemon/tools/farm/farm.hpp"

#include <algorithm>
#include <ostream>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/farm/finish.hpp"
#include "daemon/tools/farm/plan.hpp"
#include "daemon/tools/farm/scripts.hpp"
#include "daemon/tools/farm/slurm.hpp"
#include "daemon/tools/farm/status.hpp"
#include "daemon/tools/farm/task.hpp"
#include "daemon/tools/post/render_directory.hpp"
#include "drivers/error.hpp"

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

// A name without a folder is looked for in PATH by each machine; tasks do not start in this folder.
std::filesystem::path program_for(const std::filesystem::path& program) {
  if (program.empty()) return own_program();
  return program.has_parent_path() ? std::filesystem::absolute(program).lexically_normal()
                                   : program;
}

ScriptPlaces places_of(const JobFolder& folder, const Job& job,
                       const std::filesystem::path& program) {
  const auto lies_elsewhere = [&](const JobTake& take) {
    return !session::lies_within(folder.path().parent_path(), take.pictures);
  };
  return {program_for(program), folder.path(),
          job.render.any_paths || std::ranges::any_of(job.takes, lies_elsewhere)};
}

// Removes the folder of a job that was not submitted, so that the corrected command finds none.
class NewFolder {
 public:
  NewFolder(const FarmOptions& options, const JobFolder& folder, const Job& job)
      : folder_(folder), was_there_(std::filesystem::exists(folder.path())) {
    folder.refuse_links();
    make_folder(options, folder, job);
    // What an earlier job in this folder has left would be taken for this one's.
    std::error_code stays;
    folder.forget_states();
    std::filesystem::remove(folder.submitted_file(), stays);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  ~NewFolder() {
    if (is_kept_ || was_submitted(folder_))
      return;  // what could not be taken back is canceled by it
    std::error_code stays;
    std::filesystem::remove(folder_.plan(), stays);
    if (!was_there_) std::filesystem::remove_all(folder_.path(), stays);
  }
  void keep() { is_kept_ = true; }

 private:
  const JobFolder& folder_;
  const bool was_there_;
  bool is_kept_ = false;
};

void print_plan(const Job& job, const JobFolder& folder, const Division& division,
                std::ostream& out) {
  const std::uint64_t frames = job.frames(), tasks = job.tasks(frames);
  out << folder.path().string() << ": " << frames << (frames == 1 ? " frame of " : " frames of ")
      << job.takes.size() << (job.takes.size() == 1 ? " take" : " takes") << " in " << tasks
      << (tasks == 1 ? " task" : " tasks");
  if (!division.chunk && tasks < static_cast<std::uint64_t>(division.machines))
    out << " (fewer than --nodes " << division.machines
        << ", because a task of few frames also renders their neighbours, with which pictures are "
           "averaged; --chunk 2 divides it all the same)";
  if (job.sample_ranges > 1) out << ", each frame in " << job.sample_ranges << " sample ranges";
  out << ", on "
      << (job.any_device ? "whatever device there is"
          : job.on_gpu   ? "a graphics card each"
                         : "processors (--gpu asks for graphics cards)")
      << std::endl;
}

// Forgets what is finished, once for the whole job: no task does it again (`--force`).
void forget_finished(const Job& job, const std::stop_token& stop) {
  for (const JobTake& take : job.takes) {
    const post::RenderDirectory pictures({take.pictures, take.exr, take.png, false}, take.settings,
                                         /*force=*/true, {}, take.frames, stop);
    if (pictures.has_others())
      throw Error(take.pictures.string() +
                  ": is being rendered, so that its frames cannot be forgotten (--force); wait "
                  "until that has ended");
  }
}

// Throws where parts of an earlier job in this folder would be taken for those of a new one.
void refuse_where_others_wait(const JobFolder& folder) {
  if (!queued_tasks(folder).empty())
    throw Error(folder.path().string() +
                ": tasks of an earlier job in this folder are still in the queue; cancel them by "
                "`scancel --name=" +
                folder.name() + "`, or give another folder with --job");
}

void refuse_while_queued(const JobStatus& status, const JobFolder& folder) {
  if (!status.is_queued && status.count(TaskPhase::running) == 0) return;
  throw Error(folder.path().string() +
              ": tasks are still running or waiting; wait for them (`previz farm status`), or "
              "cancel them first (`previz farm cancel`)");
}

void hand_over(const FarmOptions& options, const JobFolder& folder, const Job& job,
               std::uint64_t frames, bool uses_slurm, std::ostream& out) {
  if (uses_slurm)
    submit_tasks(folder, job, job.tasks(frames), options.sbatch, out);
  else if (options.openjd)
    out << options.openjd->string() << ": submit it to a scheduler that takes Open Job Descriptions"
        << std::endl;
  else
    out << "There is no Slurm here (no program sbatch). Start this on each machine:\n  bash "
        << shell_word(folder.loop_script().string()) << std::endl;
}

// Returns the wishes of the plan with those that are given now.
Wishes merged_wishes(Wishes planned, const Wishes& now) {
  if (now.at_once > 0) planned.at_once = now.at_once;
  if (!now.partition.empty()) planned.partition = now.partition;
  if (!now.time.empty()) planned.time = now.time;
  if (!now.memory.empty()) planned.memory = now.memory;
  return planned;
}

}  // namespace

void submit(const FarmOptions& options, std::ostream& out) {
  const Job job = make_job(options);
  const JobFolder folder = folder_for(options, job);
  const ScriptPlaces places = places_of(folder, job, options.program);
  print_plan(job, folder, options.division, out);
  if (options.dry_run) {
    if (options.openjd)
      out << openjd_template(places, job, folder.name());
    else
      print_submission(folder, job, places, options.sbatch, out);
    return;
  }
  const bool uses_slurm = !options.openjd && has_slurm();
  NewFolder made(options, folder, job);
  if (uses_slurm) refuse_where_others_wait(folder);
  write_scripts(folder, places);
  if (options.render.force) forget_finished(job, options.stop);
  // Frames that were rendered before with the same settings are not rendered again.
  const Proof there = prove(folder, job, Foreign::refuse, out, options.stop);
  if (there.missing.empty()) {
    complete(folder, job, out);
    out << "all of these frames are rendered already, with these settings" << std::endl;
    return;
  }
  if (options.openjd)
    session::replace_file(*options.openjd, openjd_template(places, job, folder.name()));
  hand_over(options, folder, job, there.missing_frames(), uses_slurm, out);
  made.keep();
}

void print_status(const JobOptions& options, std::ostream& out) {
  const JobFolder folder(options.job);
  const Job job = folder.read_plan();
  const JobStatus status = status_of(folder, job);
  if (options.json)
    print_json(status, out);
  else
    print_words(folder, job, status, options.terminal, out);
}

// A task that is put back into the queue meanwhile finds the job stopped.
void cancel(const JobOptions& options, std::ostream& out) {
  const JobFolder folder(options.job);
  static_cast<void>(folder.read_plan());
  if (!was_submitted(folder))
    throw Error(
        folder.path().string() +
        ": was not submitted to Slurm; end loop.sh, or what else renders it, where it runs");
  if (queued_tasks(folder).empty()) {
    out << folder.path().string() << ": nothing is in the queue under the job's name, "
        << folder.name() << std::endl;
    return;
  }
  session::replace_file(folder.stopped_file(), "`previz farm cancel`\n");
  cancel_tasks(folder);
  out << folder.path().string()
      << ": canceled; what is finished stays, and `previz farm retry` goes on" << std::endl;
}

void retry(const JobOptions& options, std::ostream& out) {
  const JobFolder folder(options.job);
  Job job = folder.read_plan();
  job.wishes = merged_wishes(job.wishes, options.wishes);
  check_paths(folder, job, options.any_paths);
  const JobLock lock(folder, out, options.stop);
  refuse_while_queued(status_of(folder, job), folder);
  const Proof proof = prove(folder, job, Foreign::forget, out, options.stop);
  folder.forget_states();
  write_missing(folder, job, proof);
  print_missing(folder, job, proof, out);
  write_scripts(folder, places_of(folder, job, options.program));
  if (proof.missing.empty()) {
    complete(folder, job, out);
    folder.write_state(finish_name, state_now(TaskOutcome::done, post::host_name(), ""));
    out << folder.path().string() << ": every frame is there and whole" << std::endl;
  } else if (has_slurm()) {
    submit_tasks(folder, job, job.tasks(proof.missing_frames()), options.sbatch, out);
  } else {
    out << "start this on each machine:\n  bash " << shell_word(folder.loop_script().string())
        << std::endl;
  }
}

}  // namespace previz::farm
