# Sourced by the days. Each works in a folder of its own, $work, with the programs of the release build.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
previzd=$root/build/release/daemon/previzd previz=$root/build/release/daemon/previz
previzctl=$root/build/release/daemon/control/previzctl
demo=$root/config/demo
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
most_silent_s=2
steps=0

fail() {
  echo "first_day: $*" >&2
  exit 1
}

# Runs a command line on a terminal, shows what it prints, and keeps that in "$work/said". Fails if its status is
# another one, or if it was silent for more than $most_silent_s seconds, the end of the command included.
# step STATUS COMMAND...
step() {
  local wanted=$1 status=0 silent
  shift
  ((++steps))
  printf '\n%d) %s\n' "$steps" "$*"
  script -qec "$(printf '%q ' "$@")" -m advanced -O said.log -T said.times </dev/null >/dev/null || status=$?
  # Without the lines of script itself; a rewritten line is shown as it was last.
  sed '1d;$d; s/.*\r\x1b\[K//; s/\r$//' said.log >said
  cat said
  silent=$(awk '$1 == "O" { if ($2 > most) most = $2; sum += $2 }
    $3 == "DURATION" { if ($4 - sum > most) most = $4 - sum }
    END { printf "%.1f", most }' said.times)
  printf '   (status %d, silent for at most %s s)\n' "$status" "$silent"
  [[ $status == "$wanted" ]] || fail "step $steps ended with status $status, and should with $wanted"
  awk "BEGIN { exit !($silent > $most_silent_s) }" &&
    fail "step $steps was silent for $silent s: somebody who waits longer than $most_silent_s s asks whether it hangs"
  return 0
}

# Fails unless the last step said this, a part of a line.
expect() { grep -qF -- "$1" said || fail "step $steps did not say: $1"; }
never() { ! grep -qF -- "$1" said || fail "step $steps said: $1"; }
