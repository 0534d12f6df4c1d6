#!/usr/bin/env bash
# `previz farm` on a real Slurm cluster of three nodes that runs on this machine (cluster.sh): the pictures of the demo
# take, from tasks that fail in the ways of cases.sh, are held against those of one `previz render`, bit for bit. As
# root; installs Slurm with the first run. Ten minutes on two cores.
#   tests/farm/run.sh            all cases
#   tests/farm/run.sh CASE...    cases by the names that cases.sh gives them: cluster, array, power, network, ...
# PREVIZ_BUILD names a build to use in place of build/release, CLUSTER_PORT the first of the ports (cluster.sh).
# Logs, job folders and pictures are kept in build/farm.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=$PWD/tests/farm
out=$PWD/build/farm
build=$(realpath "${PREVIZ_BUILD:-build/release}")
previz=$build/daemon/previz
# A task that finds its node at fault waits this long before it is requeued.
export PREVIZ_FARM_WAIT_S=3
export MESA_SHADER_CACHE_DIR=${MESA_SHADER_CACHE_DIR:-$PWD/build/mesa_shader_cache}

# shellcheck source=tests/farm/cases.sh
source "$here/cases.sh"

# expect WHAT COMMAND...: ends the case where the command fails.
expect() {
  if "${@:2}"; then
    echo "farm: right: $1"
  else
    echo "farm: WRONG: $1"
    exit 1
  fi
}

# await SECONDS COMMAND...: runs a command until it succeeds; fails after that many seconds.
await() {
  local end=$((SECONDS + $1))
  until "${@:2}"; do
    ((SECONDS < end)) || return 1
    sleep 0.2
  done
}

# A cluster of three nodes for one case; its folder is in /tmp, because the paths of Slurm's sockets must be short.
start_cluster() {
  cluster=$(mktemp --directory /tmp/previz_farm.XXXXXX)
  "$here/cluster.sh" up "$cluster" 3
  # shellcheck source=/dev/null
  source "$cluster/env"
}

# node VERB K COMMAND...: a verb of cluster.sh on a node of the case's cluster.
node() { "$here/cluster.sh" "$1" "$cluster" "${@:2}"; }

# What a case leaves behind, whichever way it ends.
end_case() {
  local status=$?
  set +e
  if [[ -n ${cluster:-} ]]; then
    scontrol --all show job >"$folder/slurm_jobs.txt" 2>&1
    "$here/cluster.sh" down "$cluster"
    rm -rf "$folder/slurm"
    mv "$cluster/log" "$folder/slurm"
    rm -rf "$cluster"
  fi
  if [[ -n ${disk:-} ]]; then
    cp --recursive "$job" "$folder/job"
    umount --lazy "$disk"
  fi
  exit $status
}

# reference NAME RENDER_ARGUMENTS...: one run of `previz render`, whose pictures are in $out/reference/NAME. An earlier
# one is used again where arguments and program are the same.
reference() {
  local target=$out/reference/$1 made_by
  made_by="${*:2} $(stat --format='%i %Y' "$previz")"
  [[ -e $target.made_by && $(<"$target.made_by") == "$made_by" ]] && return
  rm -rf "$target" "$target.made_by"
  mkdir -p "$out/reference"
  timeout 300 "$previz" render "${@:2}" --out "$target"
  echo "$made_by" >"$target.made_by"
}

# The frames of a render without the seconds that each took.
frames_of() { sed --regexp-extended 's/"render_s":[^,}]*//' "$1/frames.jsonl"; }

files_of() { (cd "$1" && find . -type f ! -name render.lock | sort); }

# Whether two renders have the same files, bit for bit.
same_render() {
  local file
  diff <(files_of "$1") <(files_of "$2") || return 1
  while read -r file; do
    if [[ ${file##*/} == frames.jsonl ]]; then
      diff <(frames_of "$1/${file%/*}") <(frames_of "$2/${file%/*}") >/dev/null || { echo "$file differs"; return 1; }
    else
      cmp "$1/$file" "$2/$file" || return 1
    fi
  done < <(files_of "$1")
}

# submit PREVIZD_FARM_ARGUMENTS...: sets `render` and `check` to the Slurm ids.
submit() {
  timeout 60 "$previz" farm "$@" | tee "$folder/submitted.txt"
  render=$(sed -n 's/^render: job \([0-9]*\)$/\1/p' "$folder/submitted.txt")
  check=$(sed -n 's/^check: job \([0-9]*\)$/\1/p' "$folder/submitted.txt")
  expect "the ids of render and check are printed" [ -n "$render" -a -n "$check" ]
}

has_left() { [[ -z $(squeue --noheader --format=%i --jobs "$1" 2>/dev/null) ]]; }

# await_end: until the check has ended.
await_end() {
  expect "the check ends within 300 s" await 300 has_left "$check"
}

# Whether the last check ended with status 0.
has_passed() { [[ $(scontrol --oneliner show job "$check") == *" ExitCode=0:0 "* ]]; }

# job_says STATUS_PATTERN: whether `farm status` prints a line that matches, whatever status it ends with.
job_says() { { timeout 30 "$previz" farm status "$job" || true; } 2>&1 | grep --ignore-case --extended-regexp "$1"; }

# The number of the task, in the array that renders, which runs on a node.
task_on() { squeue --noheader --array --states=RUNNING --nodelist="node$1" --jobs="$render" --format=%K; }

# Whether the task on a node has rendered a frame and not yet written its last one: has_begun K FRAMES_A_TASK. Frames that
# are averaged with their neighbours are written after these.
has_begun() {
  local task log
  task=$(task_on "$1")
  [[ -n $task ]] || return 1
  log=$job/log/$(printf %04d "$task").log
  grep --quiet '^frame .*: rendered (' "$log" && (($(grep --count '^frame .*samples in' "$log") < $2))
}

# The controller learns at once that a node is lost, as from an administrator; by itself it takes 15 s.
declare_lost() { scontrol update "NodeName=node$1" State=DOWN Reason=lost; }

# Runs a case in a shell of its own and prints what became of it.
run_case() {
  local begin=$SECONDS status
  local log=$out/$1.log
  set +e
  (
    set -e
    folder=$out/cases/$1
    job=$folder/job
    # shellcheck disable=SC2034  # cases.sh uses it
    pictures=$folder/pictures
    rm -rf "$folder"
    mkdir -p "$folder"
    trap end_case EXIT
    "case_$1"
  ) >"$log" 2>&1 </dev/null
  status=$?
  set -e
  if [[ $status == 0 ]]; then
    echo "PASS $1 ($((SECONDS - begin)) s)"
  else
    failures=$((failures + 1))
    echo "FAIL $1 ($((SECONDS - begin)) s): $(grep 'farm: WRONG:' "$log" || tail --lines=1 "$log")"
  fi
}

if [[ $EUID -ne 0 ]]; then
  echo "farm: run it as root, which it needs for mounts, namespaces and Slurm's daemons" >&2
  exit 1
fi
config/install-deps.sh slurm-wlm munge util-linux python3-jsonschema python3-yaml
if [[ -z ${PREVIZ_BUILD:-} ]]; then
  [[ -e $build/CMakeCache.txt ]] || cmake --preset release --log-level=WARNING
  cmake --build "$build" --parallel "$(nproc)" --target previz
fi
mapfile -t known < <(sed -n 's/^case_\([a-z_]*\)() {$/\1/p' "$here/cases.sh")
cases=("$@")
[[ $# -gt 0 ]] || cases=("${known[@]}")
for name in "${cases[@]}"; do
  [[ " ${known[*]} " == *" $name "* ]] || { echo "farm: unknown case \"$name\"; allowed: ${known[*]}" >&2; exit 2; }
done

mkdir -p "$out"
/usr/bin/python3 -B "$here/test_check_openjd.py" --quiet
failures=0
for name in "${cases[@]}"; do run_case "$name"; done
echo "farm: $((${#cases[@]} - failures)) of ${#cases[@]} cases passed in $SECONDS s; logs are in $out"
[[ $failures == 0 ]]
