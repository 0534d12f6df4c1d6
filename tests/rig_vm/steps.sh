# What the parts share; to be sourced in the guest. A part that can say more of a failure defines
# `tell_more`.
start=$SECONDS

step() { printf '== %s (%d s) ==\n' "$*" $((SECONDS - start)); }
fail() {
  echo "rig_vm: $*" >&2
  declare -F tell_more >/dev/null && tell_more >&2
  exit 1
}
# Waits until a command succeeds: within SECONDS, WHAT.
within() {
  local seconds=$1 what=$2 end=$((SECONDS + $1))
  shift 2
  until "$@"; do
    [[ $SECONDS -lt $end ]] || fail "not within $seconds s: $what"
    sleep 1
  done
  echo "   $what"
}
