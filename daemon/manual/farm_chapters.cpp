#include "daemon/manual/farm_chapters.hpp"

namespace previz::manual {

std::vector<Chapter> farm_chapters() {
  return {
      {"HOW A JOB GOES", R"(
`previz farm TAKE` opens the take and its set, so that a mistake in them is found now and not at night, and writes the folder of the job. That folder, the takes and the folder for the pictures must be seen by all machines at the same places. Then it submits tasks and a last step to Slurm, and ends; no process of its own has to stay.
All tasks are one command, `previz farm task`. It checks what can be known before the first frame: version, take, clock, room and device. Then it renders frames that no other process has into the folder of the pictures, as several `previz render` do that share one, until it has done its share (`--chunk`), and writes into the job's folder where it runs and how it ended. Which task renders which frame is not planned: a quick machine renders more, what a task leaves is free for the others, and a task that is started again or twice takes what is left.
The last step, `previz farm finish`, runs after all tasks have ended, whichever way. It reads every file of every frame and compares its size and SHA-256 with the line that was written when it was rendered, and that the frames have the settings, the version and the kind of device of the job. If every frame is there it makes the review video; otherwise it writes missing.json and ends with 75. Only its line "every frame is there and whole" means that the job is done.
The pictures are those of `previz render` on one machine, to the last bit, as long as all machines have the same kind of graphics card and the same driver, or all render on processors.
Frames that were rendered before, in the same folder with the same settings and on the same kind of device, are kept. The set file that `--set` names, the overlay of `--with` and the files that they name are copied into the job's folder: they may be edited while the job runs. A take must not be changed meanwhile.
)"},
      {"EXAMPLE", R"(
previz farm takes/12A_take003 --out /film/renders/12A_take003 --nodes 3 --dry-run: In the evening, with a take and three machines: prints the plan, the scripts and the commands for Slurm, and writes nothing.
previz farm takes/12A_take003 --out /film/renders/12A_take003 --nodes 3: Makes the job in /film/renders/12A_take003.farm and submits it.
previz farm status /film/renders/12A_take003.farm: Says how many frames are done, which tasks run, which have failed, where and why, and about how long the rest takes.
previz farm retry /film/renders/12A_take003.farm: In the morning, if frames are missing: checks all pictures, and submits tasks for the frames that are missing or damaged.
previz farm cancel /film/renders/12A_take003.farm: Cancels what waits and runs. What is finished stays, and `previz farm retry` continues.
previz farm takes/12A_take003 takes/12B_take001 --out /film/renders --gpu --partition night --time 4:00:00: Renders two takes in one job, each into a folder of its name, with a graphics card per task.
previz farm takes/12A_take003 --cpu --nodes 20 --limit 10 --sbatch=--nice=100: Renders on processors, on at most ten machines at once, behind what others want.
previz farm takes/12A_take003 --frames 40 --spp 4096 --neighbours 0 --nodes 8: Divides the samples of one heavy frame between eight machines.
)",
       true},
      {"HEAVY FRAMES", R"(
Where there are fewer frames than machines, a frame's samples are divided into ranges, and a task renders one. Whichever finds all sums of a frame merges them into its picture. `--sample-ranges` sets their number: a power of two, at most 16. A range has at least 64 samples; `--chunk` counts ranges then. Frames whose number of samples is not fixed (`--error`, `--seconds`, `--adaptive`) and frames that are averaged with their neighbours cannot be divided: give `--neighbours 0`.
The same without a job: `previz render TAKE --sample-range 1/2 --out first` on one machine, 2/2 on another, then `previz merge TAKE first second` with the same options. The merged picture is that of one run, to the last bit, if the machines have the same kind of graphics card and driver.
)"},
      {"MACHINES THAT DIFFER", R"(
A task that finds its machine unfit ends with 75 before the first frame, and `previz farm status` shows its reason. The machine stays taken for two minutes, so that it does not refuse one task after the other, and Slurm gives the task to a machine again, three times at most. The last two of these are faults of the job, and a task ends with 1.
version: "previzd 0.1.0 is installed here, and the job was made with previzd 0.2.0": pictures of two versions may differ. Install the version of the job; the package previz-tools has all that a machine needs.
take: "the take is not found": its disk is not mounted on that machine, or at another place than where the job was made.
room: "12 MB are free, and a frame may need 190 MB": of the disk of the job or of the pictures. Make room, then call `previz farm retry`.
clock: "the clock here is 300 s behind that of the job's disk": more than a minute. Set it, best by NTP (timedatectl).
device: the job is rendered on graphics cards, and Vulkan finds none on that machine, or the other way round. Their pictures differ in the last bits. Take the machine out of the partition, or make the job with `--any-device`. Cards of several models are no fault; the last step remarks on them.
set: "the take, its set, or a file that it names was changed since the job was made": no machine can render this job to its end. Tasks that wait are cancelled, stopped.txt has the reason, and the job must be made again.
folder: "is not beside the job's folder": a job that came from elsewhere does not choose where files are written. If it is yours, `--any-paths` allows it.
)"},
      {"WITHOUT SLURM", R"(
If there is no program sbatch, the job is written and the command for it printed: `bash JOB/loop.sh`, to be started on each machine, by hand, over ssh or by any scheduler, on as many machines as there are, and on further ones later. Each renders until no frame is left, waits at the end for those of the others, takes over what they do not finish, and does the last step. Started again, it continues.
Machines know of each other by locks on files. Where the disk has none that other machines see (Lustre without `flock`, NFS with `nolock`, sshfs), each renews the times of its files in render.leases, beside the pictures, and the frames of a machine that has lost power are taken over three minutes later.
`--openjd FILE` writes the job as a template of Open Job Description (2023-09) instead, for schedulers that take it. The parameter JobFolder is the job's folder, Previzd the program on the machines.
)"},
      {"IN THE MORNING", R"(
`previz farm status JOB` first. If all frames are done it names the folder of the pictures, with review.mp4; look at the video.
If frames are missing, missing.json and the log of the last step, log/finish.log, say which and why: who is rendering them, what is wrong with a file, the words of the tasks that failed, or "not rendered" where no task has left a word: it lost power or was killed. `previz farm retry JOB` renders these and nothing else. It refuses while tasks of the job are running or waiting.
)"},
      {"EXIT STATUS", R"(
0: Done. A `task` has rendered its frames; to `finish` it means that every frame is there and whole.
1: Error; one line says what is wrong. A `task` ends with it if the job is at fault, so that no machine can do it.
2: The command line cannot be understood.
75: A `task` ends with it if the machine is at fault: another one, or a later time, mends it. `finish` does if frames are missing.
128+N: Stopped by signal N. Finished frames are on disk, and the next start of the task continues there.
)"},
      {"FILES", R"(
job.json: In the job's folder, as all of these: the plan, which is written once and read by every machine. It names no program.
set/: The set file, the overlay and the files that the set names, if the command line named any.
tasks.sh, finish.sh, loop.sh: What Slurm starts for a task and for the last step, and the script for people without a scheduler.
sums/0000/3/: The sums of sample range 3 of the first take, until the last step has seen them merged.
state/0003.json: What the task of that number said last, or the one of a machine, on-NAME.json: running, done, stopped, machine (at fault) or job (at fault), on which machine, since when, and why.
state/finish.json: The same of the last step.
log/0003.log, log/finish.log: What the tasks and the last step print under Slurm.
submitted.txt: Slurm's numbers of what was submitted last.
render.lock, render.leases/: Who is at work on the job. The last step and a retry are done by one process at a time.
stopped.txt: Why no further task starts; `previz farm retry` removes it.
missing.json: The frames that the last step found missing, with the reasons; there is none if none is missing.
)",
       true},
      {"ENVIRONMENT", R"(
PREVIZ_FARM_WAIT_S: How many seconds a machine that has refused a task stays taken under Slurm (default: 120).
SLURMD_NODENAME: The name by which messages call the machine; without it, its host name.
SLURM_CPUS_ON_NODE: A task under Slurm sets LP_NUM_THREADS to it, so that rendering on processors uses as many threads as Slurm has granted.
)"},
      {"SEE ALSO", "previz(1), previz-set(5), sbatch(1), squeue(1)"},
  };
}

}  // namespace previz::manual
