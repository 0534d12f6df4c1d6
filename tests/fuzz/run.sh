#!/usr/bin/env bash
# Lets libFuzzer look for bytes that break a reader.
#   tests/fuzz/run.sh PROGRAM SECONDS [TARGET...]     e.g. build/fuzz/tests/fuzz/fuzz 3600 gltf
#   tests/fuzz/run.sh PROGRAM merge [TARGET...]
# It begins with tests/fuzz/corpus and goes on from what was found before: found/ beside the program,
# which begins as tests/fuzz/found.tar.xz. Ends with a line a target, and with status 0 only if none
# was broken. What broke one is in crashes/ beside the program: mend the reader. If the bytes broke
# code of ours and not a library of others, keep them in tests/fuzz/corpus/TARGET, small
# (-minimize_crash=1), under a name that says what they are.
# "merge" leaves of found/ only few and small inputs that together reach all that was reached, and
# writes those of the targets in `own` to tests/fuzz/found.tar.xz, to be committed.
set -euo pipefail
# Whose bytes only code of ours reads. What another target finds may harm a library of others, be it
# without our checks before it, and stays on the machine that found it.
own=(aravis frames_csv hid v4l2 wire)
program=$(realpath "$1")
seconds=$2
cd "$(dirname "$0")/corpus"
found=$(dirname "$program")/found
[[ -d $found || ! -f ../found.tar.xz ]] || tar -C "$(dirname "$program")" -xf ../found.tar.xz
crashes=$(dirname "$program")/crashes
targets=("${@:3}")
[[ ${#targets[@]} -gt 0 ]] ||
  mapfile -t targets < <("$program" 2>/dev/null | cut -d' ' -f1)
# The files that targets read are written to memory, where there is a file system in it.
[[ ! -d /dev/shm ]] || export TMPDIR=/dev/shm
export UBSAN_OPTIONS=print_stacktrace=1 OPENCV_LOG_LEVEL=SILENT

# Prints the CPU seconds of all programs that have ended so far.
cpu_seconds() {
  awk -v hz="$(getconf CLK_TCK)" '{ print int(($16 + $17) / hz) }' "/proc/$$/stat"
}

merge() {
  local target=$1 least=$found/$1.least before
  before=$(find "$found/$target" -type f | wc -l)
  rm -rf "$least"
  mkdir "$least"
  PREVIZ_FUZZ_TARGET=$target "$program" -set_cover_merge=1 -timeout=25 -rss_limit_mb=2048 -max_len=65536 \
    "$least" "$found/$target" >"$crashes/$target.log" 2>&1
  rm -rf "${found:?}/$target"
  mv "$least" "$found/$target"
  printf '%-14s %6d inputs, of which %6d stay\n' "$target" "$before" \
    "$(find "$found/$target" -type f | wc -l)"
}
if [[ $seconds == merge ]]; then
  for target in "${targets[@]}"; do
    mkdir -p "$found/$target" "$crashes"
    merge "$target"
  done
  tar -C "$(dirname "$program")" --sort=name --owner=0 --group=0 --numeric-owner --mtime=@0 -c \
    "${own[@]/#/found/}" |
    xz -9e >../found.tar.xz
  exit
fi

status=0
for target in "${targets[@]}"; do
  mkdir -p "$found/$target" "$crashes"
  log=$crashes/$target.log
  broken=
  used=$(cpu_seconds)
  words=()  # that a format is made of, where chance would take long to find them
  [[ ! -f ../dictionary/$target ]] || words=("-dict=../dictionary/$target")
  # The time limit of an input is for a machine that is busy, and under two sanitizers.
  PREVIZ_FUZZ_TARGET=$target "$program" -max_total_time="$seconds" -timeout=25 -rss_limit_mb=2048 \
    -max_len=65536 -print_final_stats=1 -artifact_prefix="$crashes/$target-" \
    "${words[@]}" "$found/$target" "$target" >"$log" 2>&1 || broken="  BROKEN: see $log"
  [[ -z $broken ]] || status=1
  printf '%-14s %10s inputs, %6s places reached, %5d CPU s%s\n' "$target" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")" \
    "$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -1)" $(($(cpu_seconds) - used)) "$broken"
done
exit "$status"
