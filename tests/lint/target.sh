#!/usr/bin/env bash
# clang-tidy on one target: target.sh UNITY_FILE, as tests/lint/run.sh calls it in the root of the
# repository. A target that has passed leaves UNITY_FILE.passed with its line of passed.txt.
set -uo pipefail
unity=$1 root=$PWD record=tests/lint/passed.txt here=${XDG_CACHE_HOME:-$HOME/.cache}/previzd/lint
name=${unity#build/lint/} && name=${name%/Unity/*} && name=${name/CMakeFiles\//} && name=${name%.dir}
command=$(awk -v file="$unity" -F'"' '/"command"/ { c = $0 } /"file"/ && index($0, file) { print c; exit }' \
  build/lint/compile_commands.json | sed 's/^ *"command": "//; s/",$//; s/\\"/"/g; s/ -o [^ ]*//; s/ -c / -M /')
# All that the outcome depends on but the headers of libraries: the sources' and our headers' own text,
# for the checks of comments and macros, how they are compiled, the checks, and clang-tidy itself.
reads=$(cd build/lint && eval "$command" 2>"$root/$unity.log" | tr -s ' \\\n' '\n' | grep "^$root/" | grep -v "^$root/build/" | sort -u)
[[ -n $reads ]] || { printf 'lint: %s cannot be read:\n' "$unity" && cat "$unity.log" && exit 1; }
key=$({
  clang-tidy --version | grep -o 'version .*'
  cat .clang-tidy
  echo "${command#*c++ }"
  # shellcheck disable=SC2086  # a list of files
  sha256sum $reads
} | sed "s#$root/\?##g" | sha256sum | cut -c1-40)
pass() { printf '%s %s\n' "$key" "$name" >"$unity.passed"; }
[[ $LINT_ALL == 1 ]] || ! grep -qsx "$key $name" "$record" || { pass && exit; }
[[ ! -e $here/$key ]] || { pass && exit; }
if clang-tidy -quiet -p build/lint "$unity" >"$unity.log" 2>/dev/null; then
  touch "$here/$key" && pass
else
  grep -A5 -E 'error:|warning:' "$unity.log"
  exit 1
fi
