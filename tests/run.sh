#!/usr/bin/env bash
# Everything a change must pass: installs what is missing, builds, runs every test, once more under
# AddressSanitizer and UndefinedBehaviorSanitizer, and checks format and lint. Needs no GPU and
# nothing outside the repository; what lacks its data or device says so and is counted as skipped.
# Ends with one line that sums up, and with status 0 only if all of it passed.
#
#   tests/run.sh              all of it
#   tests/run.sh release      only the named steps: release asan format lint; or lint-all
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

# The .cpp files changed since this branch left origin/main, or by the last commit where it has not.
changed() {
  local base
  base=$(git merge-base HEAD origin/main 2>/dev/null)
  [[ -n $base && $base != $(git rev-parse HEAD) ]] || base=HEAD~1
  git diff --name-only --diff-filter=d "$base" -- '*.cpp'
}

# clang-tidy on the files named on standard input, for at most $1 seconds: it takes half a minute a
# file, longer than compiling it. What there was no time for is counted.
tidy() {
  local late
  rm -rf build/lint && mkdir -p build/lint
  export PREVIZ_LINT_END=$(($(date +%s) + $1))
  # shellcheck disable=SC2016  # expanded by the inner shell
  xargs -r -P "$jobs" -I{} bash -c '
    log=build/lint/$(tr / . <<<"{}")
    if [[ $(date +%s) -ge $PREVIZ_LINT_END ]]; then echo "{}" >"$log.late"; exit 0; fi
    clang-tidy -quiet -p build/release "{}" >"$log" 2>/dev/null && rm "$log"'
  local status=$?
  cat build/lint/*.cpp 2>/dev/null | grep -E 'error:|warning:' | sort -u
  late=$(find build/lint -name '*.late' | wc -l)
  [[ $late -eq 0 ]] || summaries+=("lint: no time for $late files; tests/run.sh lint-all checks them")
  return "$status"
}

config/install-deps.sh || exit 1
for name in "${steps[@]}"; do
  case $name in
    release | asan)
      check "build $name" build "$name" && check "tests $name" run_tests "$name"
      ;;
    format) check "format" format ;;
    lint | lint-all)
      [[ -f build/release/compile_commands.json ]] || cmake --preset release
      if [[ $name == lint ]]; then
        check "lint" tidy 480 < <(changed)
      else
        check "lint" tidy 86400 < <(git ls-files '*.cpp')
      fi
      ;;
    *)
      echo "tests/run.sh: no step '$name'; release, asan, format, lint and lint-all are allowed" >&2
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
