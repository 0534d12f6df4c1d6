#!/usr/bin/env bash
# Breaks each promise of the fault table in tests/coverage/faults.md once, and looks whether its test fails.
#
#   tests/mutations/run.sh           all of the mutations in tests/mutations/*.list
#   tests/mutations/run.sh NAME...   only those
#
# A mutation is a block of lines in a list:
#   name: one word
#   promise: how its row in the table begins
#   file: what is changed; its text behind "-" must be there exactly once, and becomes that behind "+"
#   program: test_<program>, and tests: the cases that must fail, as GTEST_FILTER has them
#   limit_s: a run that lasts longer has failed, since it waits in vain; 40 where there is no such line
# Works on HEAD, in a worktree and a build of its own below build/mutations. Before anything is
# changed, the cases must pass, in half of that time. A mutation that does not fit its file, or does
# not compile, is an error of the list. Ends with status 0 only if every one was caught, and
# tests/mutations/without.txt has a reason for every row of the table that has none.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
config/install-deps.sh lld || exit
lists=tests/mutations tree=build/mutations/tree build=build/mutations/build log=$PWD/build/mutations/log
export CCACHE_BASEDIR=$PWD CCACHE_DEPEND=1 CCACHE_NOHASHDIR=1
# What tests sync is synced to memory, where there is a file system in it.
[[ ! -d /dev/shm ]] || export TMPDIR=/dev/shm
export LP_NUM_THREADS=1 MESA_SHADER_CACHE_DIR=$PWD/build/mesa_shader_cache
names=()
declare -A promise file old new program tests limit passes
wrong=0

complain() { printf 'ERROR    %s\n' "$*" && wrong=$((wrong + 1)); }

while IFS= read -r line; do
  case $line in
    'name: '*) name=${line#*: } && names+=("$name") ;;
    'promise: '*) promise[$name]=${line#*: } ;;
    'file: '*) file[$name]=${line#*: } ;;
    -*) old[$name]=${old[$name]:+${old[$name]}$'\n'}${line#-} ;;
    +*) new[$name]=${new[$name]:+${new[$name]}$'\n'}${line#+} ;;
    'program: '*) program[$name]=${line#*: } ;;
    'tests: '*) tests[$name]=${line#*: } ;;
    'limit_s: '*) limit[$name]=${line#*: } ;;
    '' | '#'*) ;;
    *) complain "no line of a list: $line" ;;
  esac
done < <(cat "$lists"/*.list)

compile() { nice -n 10 cmake --build "$build" --parallel "$(nproc)" --target "test_$1" >"$log" 2>&1; }

# run NAME SECONDS: its cases; 124 or 137 if they last longer. The shell's own words on a program that
# crashes are left out.
run() {
  local binary
  # The newest: an older one is of a time when its tests lay in another folder.
  binary=$(find "$build/tests" -name "test_${program[$1]}" -type f -printf '%T@ %p\n' | sort -n)
  binary=$(realpath "${binary##* }")
  { (cd "$tree" && GTEST_FILTER=${tests[$1]} timeout -k 5 "$2" "$binary") >"$log" 2>&1; } 2>/dev/null
}

# mutate NAME: fails unless the file has the old text once
mutate() {
  local text rest
  text=$(<"$tree/${file[$1]}") || return
  rest=${text/"${old[$1]}"/}
  [[ $rest != "$text" && ${text#*"${old[$1]}"} != *"${old[$1]}"* ]] || return
  printf '%s\n' "${text/"${old[$1]}"/"${new[$1]:-}"}" >"$tree/${file[$1]}"
}

mkdir -p build/mutations
git worktree prune
if [[ -e $tree/.git ]]; then
  git -C "$tree" checkout --quiet --force --detach "$(git rev-parse HEAD)"
else
  git worktree add --quiet --detach "$tree" HEAD
fi || exit
# Compiled fast, a room at once: that is most of the time.
cmake -S "$tree" -B "$build" -G Ninja --log-level=WARNING -DCMAKE_BUILD_TYPE=Debug \
  -DCMAKE_CXX_FLAGS_DEBUG=-O0 -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=0 \
  -DPREVIZ_PRECOMPILED=ON -DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=lld >"$log" 2>&1 || { cat "$log"; exit 1; }

[[ $# == 0 ]] || names=("$@")
caught=0 survived=0
for name in "${names[@]}"; do
  [[ -n ${tests[$name]:-} ]] || { complain "no mutation '$name'" && continue; }
  grep -qF "| ${promise[$name]}" tests/coverage/faults.md || complain "$name: no row begins '${promise[$name]}'"
  key="${program[$name]} ${tests[$name]}"
  if [[ -z ${passes[$key]:-} ]]; then
    passes[$key]=no
    compile "${program[$name]}" && run "$name" $((${limit[$name]:-40} / 2)) &&
      grep -q '^\[  PASSED  \] [1-9]' "$log" && passes[$key]=yes
  fi
  [[ ${passes[$key]} == yes ]] || { complain "$name: $key does not pass as it is" && continue; }
  begin=$SECONDS status=0
  if ! mutate "$name"; then
    complain "$name: ${file[$name]} does not have its text exactly once"
  elif ! compile "${program[$name]}"; then
    complain "$name does not compile: $(grep -m 1 'error:' "$log")"
  else
    run "$name" "${limit[$name]:-40}" || status=$?
    how=$(sed -n 's/^\[  FAILED  \] \([^ ,]*\).*ms)$/\1/p' "$log" | head -n 1)
    [[ -n $how ]] || how="ends with $status in $(sed -n 's/^\[ RUN      \] //p' "$log" | tail -n 1)"
    if [[ $status == 0 ]]; then
      printf 'SURVIVED %s: %s (%s, %d s)\n' "$name" "${promise[$name]}" "${tests[$name]}" \
        $((SECONDS - begin))
      survived=$((survived + 1))
    else
      printf 'caught   %s: %s (%s, %d s)\n' "$name" "${promise[$name]}" "$how" \
        $((SECONDS - begin))
      caught=$((caught + 1))
    fi
  fi
  git -C "$tree" checkout --quiet -- "${file[$name]}"
done

# Every row of the table has a mutation, or a reason to have none; the lists were read as a whole.
rows=0 without=0
while IFS= read -r row; do
  rows=$((rows + 1)) found=
  for words in "${promise[@]}"; do [[ $row != "$words"* ]] || found=yes; done
  [[ -z $found ]] || continue
  without=$((without + 1))
  while IFS= read -r words; do
    [[ -z $words || $row != "${words%% | *}"* ]] || found=yes
  done <"$lists/without.txt"
  [[ -n $found ]] || complain "no mutation of '$row', and no reason in $lists/without.txt"
done < <(sed -n '/^# Faults/,$s/^| //p' tests/coverage/faults.md | tail -n +3)
printf 'mutations: %d caught, %d survived, %d errors; of %d rows, %d have no mutation\n' \
  "$caught" "$survived" "$wrong" "$rows" "$without"
[[ $survived == 0 && $wrong == 0 ]]
