#!/usr/bin/env bash
# Lets libFuzzer look for bytes that break a reader.
#   tests/fuzz/run.sh PROGRAM SECONDS [TARGET...]     e.g. build/fuzz/tests/fuzz/fuzz 3600 gltf
# It begins with tests/fuzz/corpus and goes on from what it found before, which is kept beside the
# program. Ends with a line a target, and with status 0 only if none was broken. What broke one is in
# crashes/ beside the program: mend the reader and keep the bytes in tests/fuzz/corpus/TARGET, small
# (-minimize_crash=1), under a name that says what they are.
set -euo pipefail
program=$(realpath "$1")
seconds=$2
cd "$(dirname "$0")/corpus"
found=$(dirname "$program")/found
crashes=$(dirname "$program")/crashes
targets=("${@:3}")
[[ ${#targets[@]} -gt 0 ]] ||
  mapfile -t targets < <("$program" 2>/dev/null | cut -d' ' -f1)
# The files that targets read are written to memory, where there is a file system in it.
[[ ! -d /dev/shm ]] || export TMPDIR=/dev/shm
export UBSAN_OPTIONS=print_stacktrace=1 OPENCV_LOG_LEVEL=SILENT
status=0
for target in "${targets[@]}"; do
  mkdir -p "$found/$target" "$crashes"
  log=$crashes/$target.log
  broken=
  words=()  # that a format is made of, where chance would take long to find them
  [[ ! -f ../dictionary/$target ]] || words=("-dict=../dictionary/$target")
  # The time limit of an input is for a machine that is busy, and under two sanitizers.
  PREVIZ_FUZZ_TARGET=$target "$program" -max_total_time="$seconds" -timeout=25 -rss_limit_mb=2048 \
    -max_len=65536 -print_final_stats=1 -artifact_prefix="$crashes/$target-" \
    "${words[@]}" "$found/$target" "$target" >"$log" 2>&1 || broken="  BROKEN: see $log"
  [[ -z $broken ]] || status=1
  printf '%-14s %10s inputs, %6s places reached%s\n' "$target" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")" \
    "$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -1)" "$broken"
done
exit "$status"
