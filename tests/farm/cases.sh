#!/usr/bin/env bash
# The cases of run.sh, in the order in which they run. Each has a folder ($folder), a job folder ($job) and a folder for
# pictures ($pictures) of its own, and a cluster of its own once it has called start_cluster.
# shellcheck disable=SC2154  # run.sh sets here, out, previz, folder, job, pictures, render and check

# The demo take has six frames; at this size a task takes seconds to start and a tenth of one for a frame, and with many
# samples a few seconds for a frame, so that it can be met in the middle.
demo=(config/demo/session --set config/demo/demo.toml)
quick=("${demo[@]}" --scale 0.1 --spp 4)
slow=("${demo[@]}" --scale 0.1 --spp 64 --no-video)
# A requeued task starts after six seconds, while its first copy is still to run.
slower=("${demo[@]}" --scale 0.1 --spp 384 --no-video)

# The test bed itself: a node without power loses its task, a cut one keeps it while a second copy runs.
case_cluster() {
  start_cluster
  # shellcheck disable=SC2016  # the task's shell expands it
  printf '%s\n' '#!/bin/bash' 'echo "task $SLURM_ARRAY_TASK_ID on $SLURMD_NODENAME begins"' 'sleep 14.25' \
    'echo "task $SLURM_ARRAY_TASK_ID on $SLURMD_NODENAME ends"' >"$folder/task.sh"
  render=$(sbatch --parsable --array=0-1 --open-mode=append --output="$folder/%a.log" "$folder/task.sh")
  expect "two tasks run" await 20 two_run
  local lost
  lost=$(task_on 1)
  node cut-node 1
  declare_lost 1
  expect "the task of a cut node runs a second time" await 30 \
    grep --quiet "task $lost on node3 begins" "$folder/$lost.log"
  expect "the first copy runs on" node on-node 1 pgrep --full 'sleep 14.25'
  node kill-node 2
  expect "a node without power runs nothing" [ "$(pgrep --full --count 'sleep 14.25')" -le 2 ]
  declare_lost 2
  node start-node 2
  expect "the task of node2 runs again" await 60 \
    grep --quiet "task $((1 - lost)) on node. ends" "$folder/$((1 - lost)).log"
  expect "the array ends" await 60 has_left "$render"
}
two_run() { [[ -n $(task_on 1) && -n $(task_on 2) ]]; }

# The demo take as an array over three nodes, with its review video.
case_array() {
  reference quick "${quick[@]}"
  start_cluster
  submit "${quick[@]}" --chunk 2 --job "$job" --out "$pictures"
  await_end
  expect "the check passes" has_passed
  expect "the bits are those of one run" same_render "$out/reference/quick" "$pictures"
  expect "nothing is missing" [ ! -s "$job/missing.json" ]
}

case_power() {
  reference slow "${slow[@]}"
  start_cluster
  submit "${slow[@]}" --chunk 3 --job "$job" --out "$pictures"
  expect "a task on node1 is in the middle of its frames" await 120 has_begun 1 3
  node kill-node 1
  declare_lost 1
  node start-node 1
  await_end
  expect "the check passes" has_passed
  expect "the bits are those of one run" same_render "$out/reference/slow" "$pictures"
}

case_network() {
  reference slower "${slower[@]}"
  start_cluster
  submit "${slower[@]}" --chunk 3 --job "$job" --out "$pictures"
  expect "a task on node1 is in the middle of its frames" await 120 has_begun 1 3
  node cut-node 1
  declare_lost 1
  expect "the task runs on node3, too" await 30 node on-node 3 pgrep --exact previz
  expect "its first copy runs on" node on-node 1 pgrep --exact previz
  await_end
  expect "the check passes" has_passed
  expect "the bits are those of one run" same_render "$out/reference/slower" "$pictures"
  node start-node 1
}

case_cancelled_task() {
  reference slow "${slow[@]}"
  start_cluster
  submit "${slow[@]}" --chunk 2 --job "$job" --out "$pictures"
  expect "a task on node2 is in the middle of its frames" await 120 has_begun 2 2
  local task
  task=$(task_on 2)
  scancel "${render}_$task"
  await_end
  expect "the check does not pass" fails has_passed
  expect "status names the task" job_says "^task 0*${task}[^0-9]"
  expect "the check says what is missing" test -s "$job/missing.json"
  retry_renders_what_is_missing
  expect "the bits are those of one run" same_render "$out/reference/slow" "$pictures"
}

case_cancelled_job() {
  reference slow "${slow[@]}"
  start_cluster
  submit "${slow[@]}" --chunk 2 --job "$job" --out "$pictures"
  expect "a task on node1 is in the middle of its frames" await 120 has_begun 1 2
  timeout 30 "$previz" farm cancel "$job"
  expect "the render leaves the queue" await 30 has_left "$render"
  expect "the check leaves the queue" await 30 has_left "$check"
  expect "status says that nothing runs" job_says 'nothing runs'
  retry_renders_what_is_missing
  expect "the bits are those of one run" same_render "$out/reference/slow" "$pictures"
}

# A job that is cancelled while its tasks wait on the nodes that refused them: none is put back into the queue.
case_cancelled_wait() {
  cp --recursive config/demo "$folder/demo"
  start_cluster
  local k
  for k in 1 2 3; do node on-node "$k" mount -t tmpfs none "$folder/demo/session"; done
  PREVIZ_FARM_WAIT_S=60 submit "$folder/demo/session" --set "$folder/demo/demo.toml" --scale 0.1 --spp 4 --chunk 2 \
    --job "$job" --out "$pictures"
  expect "status says why a task waits" await 60 job_says "waiting to be requeued: .*$folder/demo/session"
  timeout 30 "$previz" farm cancel "$job"
  expect "all leave the queue" await 40 all_have_left
  sleep 3
  expect "none comes back" all_have_left
  expect "none was requeued" fails grep --recursive --quiet requeue "$cluster/log/slurmctld.log"
  expect "status says that the job was cancelled" job_says 'stopped: .*cancel'
}

# A disk that is full: of the job's and the pictures' folders, with room for logs and for no further picture.
case_full_disk() {
  reference slow "${slow[@]}"
  local full='no space left|MB are free'
  disk=$folder/disk
  mkdir "$disk"
  mount -t tmpfs -o size=16m farm_disk "$disk"
  job=$disk/job
  pictures=$disk/pictures
  start_cluster
  submit "${slow[@]}" --chunk 3 --job "$job" --out "$pictures"
  expect "a task on node1 is in the middle of its frames" await 120 has_begun 1 3
  fill_disk 65536
  expect "a task's log says that the disk is full" await 60 \
    grep --recursive --ignore-case --extended-regexp "$full" "$job/log"
  expect "status says so" await 60 job_says "$full"
  rm "$disk/ballast"
  await_end
  has_passed || retry_renders_what_is_missing
  expect "the bits are those of one run" same_render "$out/reference/slow" "$pictures"
}

# fill_disk BYTES: leaves so much free on the case's disk.
fill_disk() {
  local free
  free=$(df --output=avail --block-size=1 "$disk" | tail --lines=1)
  fallocate --length $((free - $1)) "$disk/ballast"
}

# A picture that changes on the disk after its task has proved it: before the check looks, and after.
case_corrupted() {
  reference quick "${quick[@]}"
  start_cluster
  submit "${quick[@]}" --chunk 2 --job "$job" --out "$pictures"
  scontrol hold "$check"
  expect "the tasks end" await 120 has_left "$render"
  spoil "$pictures/0002.exr"
  scontrol release "$check"
  await_end
  expect "the check does not pass" fails has_passed
  expect "the check names frame 2" grep --word-regexp '0*2' "$job/missing.json"
  retry_renders_what_is_missing
  expect "the bits are those of one run" same_render "$out/reference/quick" "$pictures"

  spoil "$pictures/0003.exr"
  expect "the check finds it" fails timeout 60 "$previz" farm finish "$job"
  retry_renders_what_is_missing
  expect "the bits are those of one run" same_render "$out/reference/quick" "$pictures"
}

# spoil FILE: changes a byte in the middle of a file, in place, with the same size and times.
spoil() {
  local middle byte times
  times=$(mktemp)
  touch --reference="$1" "$times"
  middle=$(($(stat --format=%s "$1") / 2))
  byte=$(od --address-radix=n --format=u1 --skip-bytes=$middle --read-bytes=1 "$1")
  # shellcheck disable=SC2059  # the format is the byte
  printf "\\x$(printf %x $(((byte + 1) % 256)))" | dd of="$1" bs=1 seek=$middle conv=notrunc status=none
  touch --reference="$times" "$1"
  rm "$times"
}

# A node on which the take's disk is not mounted.
case_missing_take() {
  reference quick "${quick[@]}"
  cp --recursive config/demo "$folder/demo"
  start_cluster
  node on-node 1 mount -t tmpfs none "$folder/demo/session"
  submit "$folder/demo/session" --set "$folder/demo/demo.toml" --scale 0.1 --spp 4 --chunk 2 --job "$job" \
    --out "$pictures"
  expect "status names the take that node1 lacks" await 90 job_says "$folder/demo/session"
  node on-node 1 umount "$folder/demo/session"
  await_end
  has_passed || retry_renders_what_is_missing
  expect "the bits are those of one run" same_frames "$out/reference/quick" "$pictures"
}

# A node with another version of previz.
case_other_version() {
  reference quick "${quick[@]}"
  local version other
  version=$("$previz" --version | grep --only-matching --extended-regexp '[0-9]+\.[0-9]+\.[0-9]+')
  other=${version%?}$(((${version: -1} + 1) % 10))
  sed "s/${version//./\\.}/$other/g" "$previz" >"$folder/previz"
  chmod +x "$folder/previz"
  expect "the other previz says $other" grep --quiet "$other" <("$folder/previz" --version)
  start_cluster
  node on-node 1 mount --bind "$folder/previz" "$previz"
  submit "${quick[@]}" --chunk 2 --job "$job" --out "$pictures"
  expect "status names both versions" await 90 job_says "$other.*$version|$version.*$other"
  node on-node 1 umount "$previz"
  await_end
  has_passed || retry_renders_what_is_missing
  expect "the bits are those of one run" same_render "$out/reference/quick" "$pictures"
}

# Two frames, each in four ranges of its samples.
case_sample_ranges() {
  local ranges=("${demo[@]}" --scale 0.05 --spp 256 --neighbours 0 --frames 0-1 --no-video)
  reference ranges "${ranges[@]}"
  start_cluster
  submit "${ranges[@]}" --chunk 1 --sample-ranges 4 --job "$job" --out "$pictures"
  await_end
  expect "the check passes" has_passed
  expect "the bits are those of one run" same_render "$out/reference/ranges" "$pictures"
}

# Spaces, quotes of both kinds, a dollar sign and a newline in every path.
case_names() {
  reference quick "${quick[@]}"
  local odd=$folder/$'a "take\'s"\n$HOME %j'
  cp --recursive config/demo "$odd"
  job=$odd/$'the "job"\n%A'
  start_cluster
  submit "$odd/session" --set "$odd/demo.toml" --scale 0.1 --spp 4 --chunk 3 --job "$job" --out "$odd/the pictures"
  await_end
  expect "the check passes" has_passed
  expect "the bits are those of one run" same_frames "$out/reference/quick" "$odd/the pictures"
}

# Two takes in one command, each into a folder of its name.
case_two_takes() {
  reference quick "${quick[@]}"
  local take
  for take in first second; do
    cp --recursive config/demo/session "$folder/$take"
  done
  start_cluster
  submit "$folder/first" "$folder/second" --set config/demo/demo.toml --scale 0.1 --spp 4 --chunk 3 --job "$job" \
    --out "$pictures"
  expect "the check ends within 300 s" await 300 all_have_left
  for take in first second; do
    expect "the bits of $take are those of one run" same_frames "$out/reference/quick" "$pictures/$take"
  done
}
all_have_left() { [[ -z $(squeue --noheader --format=%i) ]]; }

# What is written without a cluster: a plan that submits nothing, and templates for farms that read Open Job
# Description.
case_without_cluster() {
  local odd=$folder/$'a "take\'s"\n$HOME %j'
  cp --recursive config/demo "$odd"
  SLURM_CONF=/nonexistent timeout 30 "$previz" farm "${quick[@]}" --chunk 2 --job "$job" --out "$pictures" --dry-run
  expect "no picture is made" [ ! -e "$pictures/0000.exr" ]
  timeout 30 "$previz" farm "${quick[@]}" --chunk 2 --job "$folder/job2" --out "$pictures" --openjd "$folder/demo.yaml"
  expect "the template is right" "$here/check_openjd.py" "$folder/demo.yaml"
  # The arguments of a template's commands have no line breaks (5.2 of the specification).
  if timeout 30 "$previz" farm "$odd/session" --set "$odd/demo.toml" --chunk 2 --job "$odd/job" --out "$odd/pictures" \
    --openjd "$folder/odd.yaml" 2>&1 | tee "$folder/odd.txt"; then
    expect "the template of odd names is right" "$here/check_openjd.py" "$folder/odd.yaml"
  else
    expect "a line break is refused" grep 'line break' "$folder/odd.txt"
  fi
}

# Three machines without a scheduler, which start the loop together. A machine has a host name and process numbers of its
# own, and one processor for lavapipe.
case_loop() {
  local ranges=("${demo[@]}" --scale 0.05 --spp 256 --neighbours 0 --frames 0-3 --no-video)
  reference loop "${ranges[@]}"
  timeout 30 "$previz" farm "${ranges[@]}" --chunk 1 --sample-ranges 2 --job "$job" --out "$pictures" \
    --openjd "$folder/job.yaml"
  on_three_machines
  expect "the bits are those of one run" same_render "$out/reference/loop" "$pictures"
  expect "nothing is missing" [ ! -s "$job/missing.json" ]
  local k
  for k in 1 2 3; do
    expect "machine $k renders" grep --quiet '^frame .*samples in' "$folder/machine$k.txt"
  done
}

# The same on a file system without locks, as Lustre without its option "flock". A machine that lost power two minutes
# ago has left a frame that says it is being rendered.
case_loop_without_locks() {
  reference quick "${quick[@]}"
  cc -shared -fPIC -o "$folder/no_locks.so" -x c - <<'END'
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
static int call(const char* name, int descriptor, int command, void* argument) {
  if (command == F_OFD_SETLK || command == F_OFD_GETLK || command == F_OFD_SETLKW) {
    errno = ENOSYS;
    return -1;
  }
  return ((int (*)(int, int, ...))dlsym(RTLD_NEXT, name))(descriptor, command, argument);
}
#define FORWARD(name)                       \
  int name(int descriptor, int command, ...) { \
    va_list rest;                           \
    va_start(rest, command);                \
    return call(#name, descriptor, command, va_arg(rest, void*)); \
  }
FORWARD(fcntl)
FORWARD(fcntl64)
END
  timeout 30 "$previz" farm "${quick[@]}" --chunk 2 --job "$job" --out "$pictures" --openjd "$folder/job.yaml"
  mkdir "$pictures/render.leases"
  echo '{"host": "lost", "pid": 7, "since": "today", "frames": [2]}' >"$pictures/render.lock"
  local lease=$pictures/render.leases/$((1 << 62))  # of the first line
  echo 'lost 7 1' >"$lease"
  touch --date='120 seconds ago' "$lease"
  LD_PRELOAD=$folder/no_locks.so on_three_machines
  expect "the bits are those of one run" same_render "$out/reference/quick" "$pictures"
  expect "each frame is rendered once" \
    [ "$(cat "$folder"/machine?.txt | grep '^frame .*samples in' | sort | uniq --repeated --check-chars=8 | wc --lines)" == 0 ]
  expect "machines wait for the lost one" grep --quiet 'frame 2 is being rendered by previzd 7 on host lost' "$folder"/machine?.txt
}

# Starts the loop on three machines at once, and expects all to end well.
on_three_machines() {
  local k machines=()
  for k in 1 2 3; do
    LP_NUM_THREADS=1 timeout 300 unshare --uts --pid --fork --mount-proc bash -c \
      'hostname "$1" && exec bash "$2"' - "machine$k" "$job/loop.sh" >"$folder/machine$k.txt" 2>&1 &
    machines+=($!)
  done
  for k in 1 2 3; do
    expect "machine $k ends the loop" wait "${machines[k - 1]}"
  done
}

# Whether a command fails.
fails() { ! "$@"; }

# The pictures alone, where take or set lie elsewhere and render.json names another folder.
same_frames() {
  diff <(files_of "$1") <(files_of "$2") || return 1
  diff <(frames_of "$1") <(frames_of "$2") >/dev/null || { echo "frames.jsonl differs"; return 1; }
  local file
  for file in "$1"/*.exr "$1"/*.png "$1"/*.mp4; do
    [[ ! -e $file ]] || cmp "$file" "$2/${file##*/}" || return 1
  done
}

# The pictures, with what tells whether one was written since.
written_pictures() {
  { find "$pictures" -name '*.exr' ! -name '.*' -printf '%f %i %T@\n' 2>/dev/null || true; } | sort
}

# Renders what is missing, and expects that the pictures which were right are as they were.
retry_renders_what_is_missing() {
  written_pictures >"$folder/before.txt"
  local lost
  timeout 60 "$previz" farm retry "$job" | tee "$folder/submitted.txt"
  check=$(sed -n 's/^check: job \([0-9]*\)$/\1/p' "$folder/submitted.txt")
  expect "retry prints the id of its check" [ -n "$check" ]
  await_end
  expect "the check passes after a retry" has_passed
  written_pictures >"$folder/after.txt"
  lost=$(comm -23 "$folder/before.txt" "$folder/after.txt" | wc -l)
  expect "at most the one picture that was wrong is written over, not $lost" [ "$lost" -le 1 ]
}
