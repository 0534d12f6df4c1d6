#!/usr/bin/env bash
# clang-tidy on one target: lint_target.sh BUILD PASSED UNITY_FILE. PASSED is a folder with a file for
# every input that has passed, named by a hash of all that the outcome depends on: the text of the
# sources and of every header they read, the checks, and clang-tidy itself. Once the time LINT_UNTIL
# (seconds since 1970) has come, a target is not looked at, and marked as left: UNITY_FILE.left.
set -uo pipefail
build=$1 passed=$2 unity=$3
if [[ $(date +%s) -ge ${LINT_UNTIL:-9999999999} ]]; then
  touch "$unity.left"
  exit 0
fi
# The sources' own text, for the checks of comments and macros; the headers' as the compiler lists them.
command=$(awk -v file="$unity" -F'"' '/"command"/ { c = $0 } /"file"/ && index($0, file) { print c; exit }' \
  "$build/compile_commands.json" | sed 's/^ *"command": "//; s/",$//; s/\\"/"/g; s/ -o [^ ]*//; s/ -c / -M /')
directory=$(pwd)
reads=$(cd "$build" && eval "$command" 2>/dev/null | tr -d '\\\n' | sed 's/^[^:]*://')
[[ -n $reads ]] || { echo "lint: no command builds $unity"; exit 1; }
# shellcheck disable=SC2086  # a list of files
key=$({ clang-tidy --version; cat .clang-tidy; (cd "$build" && cat $reads) | sed "s#$directory##"; } | sha256sum | cut -c1-40)
[[ -e $passed/$key ]] && exit 0
if clang-tidy -quiet -p "$build" "$unity" >"$unity.log" 2>/dev/null; then
  touch "$passed/$key"
else
  grep -A5 -E 'error:|warning:' "$unity.log"
  exit 1
fi
