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

# What the daemon says of itself, in previzctl's words; busctl takes a fifth of its time here.
rig_bus() { busctl --json=short "$1" org.previz.Rig1 /org/previz/Rig1 org.previz.Rig1 "$2" 2>/dev/null; }
status() { rig_bus get-property "$1" | jq -r '.data | if . == true then "yes" elif . == false then "no" else . end'; }
status_is() { [[ $(status "$1") == "$2" ]]; }
metric() { rig_bus call Metrics | jq ".data[0] | fromjson | $1 // 0"; }
# The GPU has been handed so many pictures; a plate shown for want of light or tags is none.
has_drawn() { [[ $(metric '.devices.graphics.submissions') -ge $((2 * $1)) ]]; }
above() { [[ $(metric "$1") -gt $2 ]]; }
advances() { within 120 "$2" above ".stages.\"$1\".frames" "$(metric ".stages.\"$1\".frames")"; }
main_pid() { systemctl show --property=MainPID --value previzd; }
