#include "daemon/tools/farm/command_line.hpp"

#include <CLI/CLI.hpp>

#include "daemon/tools/farm/finish.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

CLI::App& add_job_command(CLI::App& farm, const char* name, const char* about,
                          std::filesystem::path& job) {
  CLI::App& command = *farm.add_subcommand(name, about);
  command.add_option("job", job, "Folder of the job")->required();
  return command;
}

void add_any_place(CLI::App& command, bool& any_paths) {
  command.add_flag("--any-paths", any_paths,
                   "Allow pictures in a folder that is not beside the job's");
}

void add_program_options(CLI::App& command, std::filesystem::path& program,
                         std::vector<std::string>& sbatch) {
  command.add_option("--program", program,
                     "previzd on the machines of the cluster (default: the path of this one)");
  command
      .add_option("--sbatch", sbatch,
                  "Argument for sbatch, such as --sbatch=--gres=gpu:a100:1; may be given again")
      ->allow_extra_args(false);
}

void add_division(CLI::App& farm, FarmOptions& options) {
  farm.add_option("--nodes", options.division.machines,
                  "Machines that the work is divided for; any number may then do it")
      ->check(CLI::Range(1, 100'000))
      ->capture_default_str();
  farm.add_option("--chunk", options.division.chunk,
                  "Frames that a task renders at most (default: by --nodes, at most 64)")
      ->check(CLI::Range(1, 1'000'000));
  farm.add_option(
          "--sample-ranges", options.division.sample_ranges,
          "Divide each frame's samples between so many tasks, a power of two (default: 1, or "
          "more where there are fewer frames than --nodes)")
      ->check(CLI::Range(1, 16));
}

void add_wishes(CLI::App& command, Wishes& wishes) {
  command
      .add_option("--limit", wishes.at_once,
                  "Tasks that run at once at most (default: as many as Slurm allows)")
      ->check(CLI::Range(1, 100'000));
  command.add_option("--partition", wishes.partition, "Slurm's partition");
  command.add_option("--time", wishes.time, "Time limit of a task, as sbatch takes it");
  command.add_option("--mem", wishes.memory, "Memory of a task, as sbatch takes it");
}

void add_devices(CLI::App& farm, FarmOptions& options) {
  farm.add_flag_callback(
          "--gpu", [&options] { options.on_gpu = true; },
          "Render on graphics cards, one per task (default: as this computer would)")
      ->excludes(farm.add_flag_callback(
          "--cpu", [&options] { options.on_gpu = false; },
          "Render on processors, a whole machine per task"));
  farm.add_flag("--any-device", options.any_device,
                "Allow both in one take, although their pictures differ in the last bits");
}

}  // namespace

void add_farm(CLI::App& app, Commands& commands,
              const std::function<void(CLI::App&, post::RenderOptions&)>& add_render_options) {
  CLI::App& farm = *app.add_subcommand(
      "farm", "Render takes on many machines: with Slurm, another scheduler, or none");
  farm.require_subcommand(0, 1);
  farm.add_option("take", commands.farm.takes, "Session folders");
  farm.add_option("--job", commands.farm.job,
                  "Folder for the job, which all machines see (default: beside the first take's "
                  "pictures, with .farm after its name)");
  add_division(farm, commands.farm);
  add_wishes(farm, commands.farm.wishes);
  add_devices(farm, commands.farm);
  add_program_options(farm, commands.farm.program, commands.farm.sbatch);
  farm.add_flag("--dry-run", commands.farm.dry_run,
                "Print the scripts and commands, and write and submit nothing");
  farm.add_option("--openjd", commands.farm.openjd,
                  "Write the job as an Open Job Description template into this file, and do not "
                  "submit it");
  add_render_options(farm, commands.farm.render);

  CLI::App& status = add_job_command(
      farm, "status", "Say how many frames are done and which tasks have failed", commands.job.job);
  status.add_flag("--json", commands.job.json, "Print it as JSON");
  add_job_command(farm, "cancel", "Cancel the tasks that run or wait", commands.job.job);
  CLI::App& retry = add_job_command(
      farm, "retry", "Submit tasks for the frames that are missing or damaged", commands.job.job);
  add_any_place(retry, commands.job.any_paths);
  add_wishes(retry, commands.job.wishes);
  add_program_options(retry, commands.job.program, commands.job.sbatch);
  retry.footer(
      "--limit, --partition, --time and --mem are those of the first submission unless they are "
      "given; --program and --sbatch are not remembered, and are given again.");
  CLI::App& task = add_job_command(
      farm, "task", "Render frames of a job that no other task has, as each of its tasks does",
      commands.task.job);
  task.add_option(
          "number", commands.task.number,
          "Number of the task, which ends with its share of the frames (default: it renders "
          "until none is left)")
      ->check(CLI::Range(0, 1'000'000));
  // In the loop of a job of an earlier previz.
  task.add_flag("--not-if-taken")->group("");
  add_any_place(task, commands.task.any_paths);
  CLI::App& finish = add_job_command(
      farm, "finish", "Prove that every frame is there and whole, and make the review video",
      commands.job.job);
  finish.add_flag(
      "--any-device", commands.job.any_device,
      "Take frames of graphics cards and of processors, whatever the job was made with");
  add_any_place(finish, commands.job.any_paths);
}

int do_farm(const CLI::App& app, Commands& commands, bool terminal, std::ostream& out,
            const std::stop_token& stop) {
  const CLI::App& farm = *app.get_subcommand("farm");
  commands.job.stop = commands.task.stop = commands.farm.stop = stop;
  commands.job.terminal = terminal;
  if (farm.got_subcommand("status")) return print_status(commands.job, out), 0;
  if (farm.got_subcommand("cancel")) return cancel(commands.job, out), 0;
  if (farm.got_subcommand("retry")) return retry(commands.job, out), 0;
  if (farm.got_subcommand("task")) return run_task(commands.task, this_machine(), out);
  if (farm.got_subcommand("finish")) return finish(commands.job, out);
  if (commands.farm.takes.empty())
    throw Error(
        "farm: give the folders of takes, or one of status, cancel, retry, task and finish with "
        "the folder of a job");
  submit(commands.farm, out);
  return 0;
}

}  // namespace previz::farm
