#include "daemon/tools/farm/scripts.hpp"

#include <nlohmann/json.hpp>

#include "drivers/error.hpp"

namespace previz::farm {
namespace {

using Json = nlohmann::ordered_json;

// Waits for previzd also where a signal to all processes of the job interrupts the waiting: it ends
// by itself, with what it has finished on disk.
constexpr const char* wait_for_previzd = R"sh(pid=$!
trap 'is_ended=1' TERM INT
while :; do
  wait "$pid"
  status=$?
  kill -0 "$pid" 2>/dev/null || break
done
)sh";

std::string head(const ScriptPlaces& places, const char* about) {
  return std::string("#!/bin/bash\n# ") + about +
         "\n# Written by `previz farm`, and not read by it again.\nprevizd=" +
         shell_word(places.program.string()) + "\njob=" + shell_word(places.job.string()) + "\n";
}

std::string call(const ScriptPlaces& places, const std::string& what) {
  return "\"$previzd\" farm " + what + (places.any_paths ? " --any-paths" : "");
}

// Slurm replaces what follows a % in the name of a log, and nothing in one with a backslash.
bool is_plain(const std::filesystem::path& path) {
  return path.string().find_first_of("%\\") == std::string::npos;
}

// Returns a line by which a script writes its own log, where Slurm cannot.
std::string own_log(const ScriptPlaces& places, const std::string& name) {
  return is_plain(places.job) ? "" : "exec >>\"$job/log/" + name + "\" 2>&1\n";
}

// Adds what the job asks for, which the user's own arguments may replace.
void add_wishes_of(const Job& job, std::vector<std::string>& arguments) {
  arguments.emplace_back("--requeue");
  if (!job.wishes.partition.empty()) arguments.push_back("--partition=" + job.wishes.partition);
  if (!job.wishes.time.empty()) arguments.push_back("--time=" + job.wishes.time);
}

// Asks for a graphics card, or for all of a processor and the memory beside it.
void add_device(const Job& job, std::vector<std::string>& arguments) {
  arguments.emplace_back(job.on_gpu ? "--gres=gpu:1" : "--exclusive");
  if (!job.wishes.memory.empty())
    arguments.push_back("--mem=" + job.wishes.memory);
  else if (!job.on_gpu)
    arguments.emplace_back("--mem=0");
}

// Adds what the job is found by, and its tasks find their way by. It stands after the user's own
// arguments, because sbatch takes the last of two.
void add_fixed(const JobFolder& folder, const std::string& log,
               std::vector<std::string>& arguments) {
  const bool plain = is_plain(folder.path());
  arguments.push_back("--job-name=" + folder.name());
  arguments.push_back("--chdir=" + (plain ? folder.path().string() : "/"));
  arguments.push_back("--output=" + (plain ? "log/" + log : "/dev/null"));
  arguments.emplace_back("--open-mode=append");
}

std::string dependency(const std::vector<std::string>& after) {
  std::string text = "--dependency=afterany";
  for (const std::string& job : after) text += ":" + job;
  return text;
}

Json openjd_step(const char* name, const ScriptPlaces& places, std::vector<std::string> arguments) {
  if (places.any_paths) arguments.emplace_back("--any-paths");
  arguments.insert(arguments.begin(), "farm");
  // SIGTERM, and SIGKILL only after this time: the frame in hand is given up, and those before it
  // are on disk.
  const Json ending{{"mode", "NOTIFY_THEN_TERMINATE"}, {"notifyPeriodInSeconds", 30}};
  Json step;
  step["name"] = name;
  step["script"]["actions"]["onRun"] = {
      {"command", "{{Param.Previzd}}"}, {"args", std::move(arguments)}, {"cancelation", ending}};
  return step;
}

}  // namespace

std::string shell_word(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

std::string slurm_tasks(const ScriptPlaces& places) {
  return head(places, "A task of a Slurm array: renders frames that no other has.") +
         R"sh(task=$((SLURM_ARRAY_TASK_ID + ${1:-0}))
is_ended=
log=$(printf %04d "$SLURM_ARRAY_TASK_ID").log
[[ ${1:-0} == 0 ]] || log=$1+$log
# Slurm gives a task processors, and only some sites hold it to them.
[[ -z ${SLURM_CPUS_ON_NODE:-} ]] || export LP_NUM_THREADS=$SLURM_CPUS_ON_NODE
)sh" + own_log(places, "$log") +
         call(places, "task \"$job\" \"$task\"") + " &" + "\n" + wait_for_previzd +
         R"sh(if [[ $status == 75 && -z $is_ended && ${SLURM_RESTART_COUNT:-0} -lt 3 ]]; then
  # This machine stays taken for a while, so that it does not refuse one task after the other. A
  # signal to this script or to the waiting ends the task: whoever cancels it wants it no more.
  sleep "${PREVIZ_FARM_WAIT_S:-120}" &
  wait $! && [[ -z $is_ended ]] && scontrol requeue "$SLURM_JOB_ID" && sleep 60
fi
[[ $status != 1 ]] || scancel --state=PENDING "$SLURM_ARRAY_JOB_ID"
exit "$status"
)sh";
}

std::string slurm_finish(const ScriptPlaces& places) {
  return head(places, "The last step of a job: proves that every frame is there and whole.") +
         own_log(places, "finish.log") + call(places, "finish \"$job\"") + "\n";
}

std::string shell_loop(const ScriptPlaces& places) {
  return head(places,
              "Renders a job without a scheduler, on as many machines as it is started on.") +
         R"sh(set -u
# Ctrl-C ends this script, and not only the task in hand, which ends by itself with status 0.
trap 'exit 130' INT
trap 'exit 143' TERM
)sh" + call(places, "task \"$job\"") +
         R"sh(
status=$?
if [[ $status == 75 ]]; then
  echo "this machine leaves the job, for the reason above; others go on with it, and the last of" \
    "them does the last step. Start it here again once that is mended." >&2
fi
[[ $status == 0 ]] || exit "$status"
)sh" + call(places, "finish \"$job\"") +
         "\n";
}

std::string openjd_template(const ScriptPlaces& places, const Job& job, const std::string& name) {
  for (const std::filesystem::path& path : {places.job, places.program})
    for (const char c : path.string())
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
        throw Error(path.string() +
                    ": an Open Job Description allows no control characters, such as a line break, "
                    "in a path; rename it, or give another folder with --job");
  Json json;
  json["specificationVersion"] = "jobtemplate-2023-09";
  json["name"] = name;
  json["parameterDefinitions"] = Json::array(
      {Json{{"name", "JobFolder"},
            {"type", "PATH"},
            {"objectType", "DIRECTORY"},
            {"dataFlow", "INOUT"},
            {"default", places.job.string()}},
       Json{{"name", "Previzd"}, {"type", "STRING"}, {"default", places.program.string()}}});
  Json render =
      openjd_step("Render", places, {"task", "{{Param.JobFolder}}", "{{Task.Param.Number}}"});
  render["parameterSpace"]["taskParameterDefinitions"] =
      Json::array({Json{{"name", "Number"},
                        {"type", "INT"},
                        {"range", "0-" + std::to_string(job.tasks(job.frames()) - 1)}}});
  Json finish = openjd_step("Finish", places, {"finish", "{{Param.JobFolder}}"});
  finish["dependencies"] = Json::array({Json{{"dependsOn", "Render"}}});
  json["steps"] = Json::array({std::move(render), std::move(finish)});
  return json.dump(2) + "\n";
}

std::vector<std::string> sbatch_arguments(const JobFolder& folder, const Job& job,
                                          std::uint64_t offset, std::uint64_t count,
                                          const std::vector<std::string>& after,
                                          const std::vector<std::string>& more) {
  std::vector<std::string> arguments{"--parsable"};
  add_wishes_of(job, arguments);
  add_device(job, arguments);
  arguments.insert(arguments.end(), more.begin(), more.end());
  // %4a has at least four digits, as the states of tasks have.
  add_fixed(folder, (offset == 0 ? "" : std::to_string(offset) + "+") + "%4a.log", arguments);
  arguments.push_back("--array=0-" + std::to_string(count - 1) +
                      (job.wishes.at_once > 0 ? "%" + std::to_string(job.wishes.at_once) : ""));
  arguments.push_back("--comment=" + std::to_string(offset));  // by which squeue names the task
  if (!after.empty()) arguments.push_back(dependency(after));
  arguments.push_back(folder.task_script().string());
  arguments.push_back(std::to_string(offset));
  return arguments;
}

std::vector<std::string> sbatch_finish_arguments(const JobFolder& folder, const Job& job,
                                                 const std::vector<std::string>& after,
                                                 const std::vector<std::string>& more) {
  std::vector<std::string> arguments{"--parsable"};
  add_wishes_of(job, arguments);
  arguments.insert(arguments.end(), more.begin(), more.end());
  add_fixed(folder, "finish.log", arguments);
  arguments.push_back(dependency(after));
  arguments.push_back(folder.finish_script().string());
  return arguments;
}

}  // namespace previz::farm
