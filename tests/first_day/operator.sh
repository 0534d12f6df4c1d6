#!/usr/bin/env bash
# An operator has a running rig, its buttons (here previzctl), and a set file that somebody edits meanwhile.
if [[ -z ${PREVIZ_OWN_BUS:-} ]]; then
  PREVIZ_OWN_BUS=1 exec dbus-run-session -- "$0" "$@"
fi
export DBUS_SYSTEM_BUS_ADDRESS=$DBUS_SESSION_BUS_ADDRESS
source "$(dirname "$0")/day.sh"

cp -r "$demo"/{demo.toml,session,phantom.glb,virtual.glb,pane.gltf,sprout.glb} .
cat >>demo.toml <<'SET'
[recording]
directory = "takes"
[display]
driver = "headless"
SET
step 1 "$previzctl" status
expect "is not running"

"$previzd" run demo.toml --loop --bus --out live >rig.log 2>&1 &
rig=$!
trap 'kill "$rig" 2>/dev/null || true; wait "$rig" 2>/dev/null || true; rm -rf "$work"' EXIT
# wait_for SECONDS WHAT COMMAND...  asks again until the command says WHAT.
wait_for() {
  local end=$((SECONDS + $1)) what=$2
  shift 2
  until "$@" 2>&1 | grep -F -- "$what" >/dev/null; do
    kill -0 "$rig" || fail "the rig has ended: $(tail -5 rig.log)"
    ((SECONDS < end)) || fail "$* does not say \"$what\": $("$@" 2>&1)"
    sleep 0.2  # until it is asked again
  done
}
wait_for 60 "live" "$previzctl" status
step 0 "$previzctl" status

# A take, and "good" pressed while it is being written, and once more when the set file has been saved.
step 0 "$previzctl" record on
sleep 3  # that is the take
step 0 "$previzctl" record off
step 0 "$previzctl" action mark_good
step 0 "$previzctl" mode review
wait_for 30 "review" "$previzctl" status
step 0 "$previzctl" mode live
touch demo.toml
sleep 1  # the rig looks once a second: it may be loading now
step 0 "$previzctl" status
wait_for 60 "live" "$previzctl" status
step 0 "$previzctl" action mark_good
step 0 "$previzctl" mode review
step 0 "$previzctl" mode live
step 0 "$previz" takes list takes
expect "good"
step 0 "$previz" takes check takes/demo_take001

# What is wrong with a set file that was saved is said, with its line; the rig goes on with the old one.
cp demo.toml right.toml
echo 'samples = 0' >>demo.toml
wait_for 30 "demo.toml:" "$previzctl" status
step 0 "$previzctl" status
cp right.toml demo.toml

step 0 "$previzctl" action snapshot
kill "$rig"
wait "$rig" || fail "the rig ended with status $?"
[[ -s out/screen.png || -s live/screen.png ]] || fail "there is no picture of the screen"
