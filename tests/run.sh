#!/usr/bin/env bash
# Everything a change must pass. Installs what is missing, builds, runs the tests, those that read
# foreign bytes or run in threads under AddressSanitizer and UndefinedBehaviorSanitizer, and checks
# format and lint. Needs no GPU and nothing outside the repository. Ends with one line that sums up,
# and with status 0 only if all of it passed.
#
#   tests/run.sh              the gate: release asan format lint
#   tests/run.sh full         the gate, with all tests in release, and then
#                             bench lint-all long gpu_code other_devices debian13 asan-all tsan fuzz mutations soak package
#                             farm rig_vm first_day
#   tests/run.sh STEP...      only the named steps
#
#   release    builds everything but the benchmarks and soak, and runs the tests; in the gate without
#              those that asan has
#   asan       the tests marked SANITIZED (tests/CMakeLists.txt) under ASan and UBSan
#   format     clang-format, and the subjects of the last commits
#   lint       clang-tidy on every target that has changed since it passed (tests/lint/run.sh)
#   lint-all   the same on every target that has not passed on this machine
#   bench      builds the benchmarks and the programs that measure, and runs their test
#   long       the cases that tests/*/CMakeLists.txt leave out of the gate (LONG), in the release build
#   gpu_code   what the compilers of five GPUs make of the shaders: registers, spills, lanes
#              (tests/gpu_code/run.sh)
#   other_devices  the renderer's tests on other CPU drivers, and as if on four graphics cards
#              (tests/other_devices/run.sh)
#   debian13   builds, runs the tests and the demo, and installs the package in Debian 13
#              (tests/debian13/run.sh)
#   asan-all   every test program under ASan and UBSan, with two storms of five minutes (tests/storm)
#   tsan       the programs that run in threads of ours and without a GPU, whose driver's threads it
#              cannot see into, under ThreadSanitizer, with the same storms (CMakePresets.json)
#   fuzz       libFuzzer on every reader of foreign bytes, a minute each (tests/fuzz/run.sh)
#   mutations  breaks each promise of the fault table once, and looks whether its test fails
#              (tests/mutations/run.sh)
#   soak       half an hour of a whole rig (tests/soak)
#   package    builds the packages and installs them in a bare Debian (tests/package/run.sh)
#   farm       renders on a Slurm cluster on this machine, and brings faults upon its tasks
#              (tests/farm/run.sh), and tests the checker of Open Job Description templates
#   rig_vm     runs the drivers, then the package, on a rig in a VM, and brings faults upon it
#              (tests/rig_vm/run.sh)
#   first_day  the first days of a student, an operator and a director, typed on a terminal
#              (tests/first_day/run.sh)
# package needs root or user namespaces, rig_vm, gpu_code, debian13 and farm need root, and these five and
# other_devices the network.
#
# A case may be skipped only if tests/skips.txt says why; any other skip is a failure.
set -uo pipefail
cd "$(dirname "$0")/.." || exit
jobs=$(nproc)
export CCACHE_DEPEND=1  # a compiler cache that is empty needs no preprocessor of its own
gate=(release asan format lint)
steps=("$@")
gate_only=OFF
[[ ${#steps[@]} -gt 0 ]] || { steps=("${gate[@]}") gate_only=ON; }
[[ ${steps[*]} != full ]] || steps=("${gate[@]}" bench lint-all long gpu_code other_devices debian13 asan-all
  tsan fuzz mutations soak package farm rig_vm first_day)
failures=()
summaries=()
costs=()

# Processor seconds of all commands that have ended, user and system.
cpu_seconds() { awk -v hz="$(getconf CLK_TCK)" '{ printf "%d", ($16 + $17) / hz }' "/proc/$$/stat"; }

# Runs a command; a failure is noted, not fatal, so that one run shows everything that is wrong.
check() {
  local name=$1
  shift
  printf '\n== %s ==\n' "$name"
  local begin=$SECONDS cpu status=0
  cpu=$(cpu_seconds)
  "$@" || status=$?
  local cost
  cost=$(printf '%-14s %5d s  %6d CPU s' "$name" $((SECONDS - begin)) $(($(cpu_seconds) - cpu)))
  costs+=("$cost")
  printf '== %s%s ==\n' "$cost" "$([[ $status == 0 ]] || echo '  FAILED')"
  [[ $status == 0 ]] || failures+=("$name")
  return "$status"
}

build() {
  local options=()
  [[ $1 != release ]] || options=(-DPREVIZ_GATE="$gate_only")
  cmake --preset "$1" --log-level=WARNING "${options[@]}" &&
    cmake --build --preset "$1" --parallel "$jobs"
}

# Prints the cases that CTest's log says were skipped, and fails if tests/skips.txt lacks one.
check_skips() {
  local log=$1 name pattern excused status=0
  while read -r name; do
    excused=
    while read -r pattern _; do
      # shellcheck disable=SC2053  # the right side is a pattern
      [[ -n $pattern && $pattern != \#* && $name == $pattern ]] && excused=1 && break
    done <tests/skips.txt
    if [[ -n $excused ]]; then
      printf '  skipped: %s\n' "$name"
    else
      printf '  SKIPPED WITHOUT AN EXCUSE in tests/skips.txt: %s\n' "$name"
      status=1
    fi
  done < <(grep '^\[  SKIPPED \] .* ms)$' "$log" | sed 's/^\[  SKIPPED \] //; s/ ([0-9]* ms)$//' | sort -u)
  return "$status"
}

# CTest counts programs; the cases in them, and which of those were skipped, are in its log. Some
# programs mostly wait, so there is one more at a time than there are cores, and another one of those
# that have a sanitizer.
# run_tests PRESET [CTEST_OPTION]...
run_tests() {
  local preset=$1 log=build/$1/Testing/Temporary/LastTest.log status=0
  local at_once=$((jobs + 1))
  [[ $preset == release ]] || at_once=$((jobs + 2))
  ctest --preset "$preset" --parallel "$at_once" "${@:2}" || status=$?
  check_skips "$log" || status=1
  summaries+=("$preset: $(grep -c '^\[       OK \]' "$log") passed, $(grep -c \
    '^\[  FAILED  \] .* ms)$' "$log") failed, $(grep -c '^\[  SKIPPED \] .* ms)$' "$log") skipped")
  return "$status"
}

# Builds a preset and runs its tests; the gate leaves the long ones out.
build_and_test() {
  check "build $1" build "$1" && check "tests $1" run_tests "$1" --label-exclude long
}

bench() {
  local status=0
  cmake --preset release --log-level=WARNING -DPREVIZ_BENCH=ON &&
    cmake --build --preset release --parallel "$jobs" && run_tests release --tests-regex equal_error || status=$?
  cmake --preset release --log-level=WARNING -DPREVIZ_BENCH=OFF >/dev/null
  return "$status"
}

fuzz() {
  config/install-deps.sh clang libclang-rt-14-dev && build fuzz &&
    tests/fuzz/run.sh build/fuzz/tests/fuzz/fuzz 60
}

soak() {
  cmake --preset release --log-level=WARNING && cmake --build --preset release --parallel "$jobs" --target soak &&
    build/release/tests/soak/soak --minutes 30
}

# Subjects read `area: verb object`, and what is not built is not committed.
format() {
  local status=0
  git ls-files '*.cpp' '*.hpp' | xargs clang-format --dry-run -Werror || status=1
  git log -20 --no-merges --format='%h %s' | grep -E 'not (built|tested|run)\)|^[^ ]+ [^:]*$' && status=1 &&
    echo 'format: these subjects are not "area: verb object" of what was built'
  return "$status"
}

config/install-deps.sh || exit 1
for name in "${steps[@]}"; do
  case $name in
    release | asan) build_and_test "$name" ;;
    asan-all | tsan) PREVIZ_STORM_S=300 build_and_test "$name" ;;  # each of the two storms
    long) build release && check "long" run_tests release --label-regex long ;;
    format) check "format" format ;;
    lint) check "lint" tests/lint/run.sh ;;
    lint-all) check "lint-all" tests/lint/run.sh all ;;
    bench | fuzz | soak) check "$name" "$name" ;;
    mutations | package | rig_vm | farm | gpu_code | other_devices | debian13 | first_day) check "$name" "tests/$name/run.sh" ;;
    *)
      echo "tests/run.sh: no step '$name'; allowed: full, or of release, asan, format, lint," \
        "bench, lint-all, long, gpu_code, other_devices, debian13, asan-all, tsan, fuzz, mutations, soak," \
        "package, farm, rig_vm and first_day" >&2
      exit 2
      ;;
  esac
done

printf '\n'
for line in "${costs[@]:-}" "${summaries[@]:-}"; do [[ -n $line ]] && printf '%s\n' "$line"; done
if [[ ${#failures[@]} -eq 0 ]]; then
  printf 'tests/run.sh: PASSED in %d min (%s)\n' $(((SECONDS + 59) / 60)) "${steps[*]}"
else
  printf 'tests/run.sh: FAILED:'
  printf ' [%s]' "${failures[@]}"
  printf '\n'
  exit 1
fi
