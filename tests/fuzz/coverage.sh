#!/usr/bin/env bash
# Says how much of each room's code the fuzzer's inputs reach, and which of its largest functions
# no target reaches: a reader among them lacks a target, or the words of its format in dictionary/.
#   tests/fuzz/coverage.sh [FOUND]    e.g. build/fuzz/tests/fuzz/found, what a run of run.sh has left
# It builds the fuzzer once more, under build/fuzz_coverage, with clang's counters, and runs the
# corpus, tests/fuzz/found.tar.xz and FOUND through it. Of a room only what is linked to the targets
# counts, which is more than its readers: rooms of devices and of what is computed stay low.
set -euo pipefail
found=${1:+$(realpath "$1")}
cd "$(dirname "$0")/../.."
config/install-deps.sh clang libclang-rt-14-dev llvm-14
build=build/fuzz_coverage
counters="-fprofile-instr-generate -fcoverage-mapping"
cmake --preset fuzz -B $build --log-level=WARNING -DCMAKE_CXX_FLAGS="$counters" -DCMAKE_EXE_LINKER_FLAGS="$counters"
cmake --build $build --target fuzz --parallel "$(nproc)"
program=$build/tests/fuzz/fuzz
profiles=$build/profiles
rm -rf $profiles
mkdir $profiles
[[ ! -f tests/fuzz/found.tar.xz ]] || tar -C $profiles -xf tests/fuzz/found.tar.xz

# With counters inputs take longer; one that took too long would end the run, and leave no counts.
for target in $($program 2>/dev/null | cut -d' ' -f1); do
  folders=(tests/fuzz/corpus/"$target")
  for more in $profiles/found ${found:+"$found"}; do
    [[ ! -d $more/$target ]] || folders+=("$more/$target")
  done
  LLVM_PROFILE_FILE=$profiles/$target.raw PREVIZ_FUZZ_TARGET=$target \
    $program -runs=0 -timeout=100 -max_len=65536 "${folders[@]}" >$profiles/"$target".log 2>&1 ||
    echo "$target: ended early, see $profiles/$target.log" >&2
done
llvm-profdata-14 merge -sparse $profiles/*.raw -o $profiles/all
sources=(daemon drivers)

echo "Lines of each room that the targets reach, of those that were compiled into them:"
llvm-cov-14 report $program -instr-profile=$profiles/all "${sources[@]}" |
  awk '$1 ~ /\.(cpp|hpp)$/ {
         room = $1; sub(/\/[^\/]*$/, "", room)
         lines[room] += $8; missed[room] += $9
       }
       END {
         for (room in lines)
           printf "%-24s %6d lines, %5.1f %% reached\n", room, lines[room],
                  100 * (1 - missed[room] / lines[room])
       }' | sort

echo "The ten largest functions of these rooms that no target reaches:"
llvm-cov-14 report $program -instr-profile=$profiles/all -show-functions \
  -show-branch-summary=false -Xdemangler=c++filt "${sources[@]}" |
  awk -v root="$PWD/" '
    /^File / { file = $2; gsub(/[\047:]/, "", file); sub(root, "", file) }
    NF >= 7 && $NF == "0.00%" && $(NF - 2) ~ /^[0-9]+$/ && $1 != "TOTAL" {
      lines = $(NF - 2)
      sub(/ +[0-9]+ +[0-9]+ +[0-9.]+% +[0-9]+ +[0-9]+ +[0-9.]+%$/, "")
      sub(/^unity_[0-9]+_cxx\.cxx:/, "")
      gsub(/\(anonymous namespace\)::|previz::/, "")
      sub(/\(.*/, "")
      printf "%4d lines  %s: %s\n", lines, file, $0
    }' | sort -rn | awk '!seen[$0]++' | head -n 10
