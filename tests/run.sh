#!/usr/bin/env bash
# Everything a change must pass: installs what is missing, builds, runs every test, once more under
# AddressSanitizer and UndefinedBehaviorSanitizer, and checks format and lint. Needs no GPU and
# nothing outside the repository; what lacks its data or device says so and is counted as skipped.
# Ends with one line that sums up, and with status 0 only if all of it passed.
#
#   tests/run.sh              all of it
#   tests/run.sh release      only the named steps: release asan format lint
# Two more steps are taken only if they are named, for they need root or user namespaces, and time:
#   package   builds the .deb, and installs it in a bare Debian (tests/package/run.sh, 3 minutes)
#   rig_vm    runs the drivers, then that, on a rig in a VM (tests/rig_vm/run.sh, 45 minutes)
set -uo pipefail
cd "$(dirname "$0")/.." || exit
jobs=$(nproc)
steps=("$@")
[[ ${#steps[@]} -gt 0 ]] || steps=(release asan format lint)
failures=()
summaries=()

step() { printf '\n== %s ==\n' "$*"; }

# Runs a command; a failure is noted, not fatal, so that one run shows everything that is wrong.
check() {
  local name=$1
  shift
  step "$name"
  local begin=$SECONDS
  if "$@"; then
    printf '== %s: %d s ==\n' "$name" $((SECONDS - begin))
  else
    printf '== %s: FAILED after %d s ==\n' "$name" $((SECONDS - begin))
    failures+=("$name")
    return 1
  fi
}

build() { cmake --preset "$1" && cmake --build --preset "$1" --parallel "$jobs"; }

# CTest counts programs; the cases in them, and which of those were skipped and why, are in its log.
run_tests() {
  local preset=$1 log=build/$1/Testing/Temporary/LastTest.log status=0
  ctest --preset "$preset" --parallel "$jobs" || status=$?
  local passed skipped failed
  passed=$(grep -c '^\[       OK \]' "$log")
  skipped=$(grep -c '^\[  SKIPPED \] .* ms)$' "$log")
  failed=$(grep -c '^\[  FAILED  \] .* ms)$' "$log")
  if [[ $skipped -gt 0 ]]; then
    printf 'Skipped:\n'
    grep '^\[  SKIPPED \] .* ms)$' "$log" | sed 's/^\[  SKIPPED \]/ /; s/ ([0-9]* ms)$//'
  fi
  summaries+=("$preset: $passed passed, $skipped skipped, $failed failed")
  return "$status"
}

sources() { git ls-files '*.cpp' '*.hpp'; }

format() { sources | xargs clang-format --dry-run -Werror; }

# clang-tidy on all sources, a target's at once: most of its time goes into the headers of the
# libraries, which so are read once a target. The longest come first.
lint() {
  rm -rf build/lint
  cmake --preset lint || return
  cmake --build build/lint --target previz_render_shaders previz_tracer_shaders || return
  find build/lint -name 'unity_*.cxx' -print0 | xargs -0 ls -S |
    xargs -P "$jobs" -I{} sh -c 'clang-tidy -quiet -p build/lint "$1" >"$1.log" 2>/dev/null' - {}
  local status=$?
  find build/lint -name 'unity_*.cxx.log' -exec cat {} + | grep -A5 -E 'error:|warning:'
  return "$status"
}

config/install-deps.sh || exit 1
for name in "${steps[@]}"; do
  case $name in
    release | asan)
      check "build $name" build "$name" && check "tests $name" run_tests "$name"
      ;;
    format) check "format" format ;;
    lint) check "lint" lint ;;
    package | rig_vm) check "$name" "tests/$name/run.sh" ;;
    *)
      echo "tests/run.sh: no step '$name'; release, asan, format, lint, package and rig_vm are" \
        "allowed" >&2
      exit 2
      ;;
  esac
done

printf '\n'
for summary in "${summaries[@]:-}"; do [[ -n $summary ]] && printf '%s\n' "$summary"; done
if [[ ${#failures[@]} -eq 0 ]]; then
  printf 'tests/run.sh: PASSED in %d min (%s)\n' $(((SECONDS + 59) / 60)) "${steps[*]}"
else
  printf 'tests/run.sh: FAILED:'
  printf ' [%s]' "${failures[@]}"
  printf '\n'
  exit 1
fi
