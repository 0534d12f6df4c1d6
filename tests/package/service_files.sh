#!/usr/bin/env bash
# The unit, its script and the udev rules, without a systemd that runs. tests/CMakeLists.txt calls it.
set -euo pipefail
cd "$(dirname "$0")/../../systemd"
fail() {
  echo "service_files: $*" >&2
  exit 1
}

# What systemd-analyze does not weigh, or weighs less than it rounds by.
for line in StartLimitIntervalSec=0 StateDirectoryMode=0750 CacheDirectoryMode=0750 \
  RuntimeDirectoryMode=0750 OOMScoreAdjust=-500 OOMPolicy=continue MemoryHigh=90% TasksMax=512 \
  LimitCORE=0 KeyringMode=private IPAddressDeny=any SocketBindDeny=any SocketBindAllow=ipv4:udp \
  "SystemCallFilter=landlock_create_ruleset landlock_add_rule landlock_restrict_self" \
  RestartForceExitStatus=75 LockPersonality=yes ProtectHostname=yes RemoveIPC=yes UMask=0027 \
  NoExecPaths=/; do
  grep -qx "$line" previzd.service || fail "previzd.service has no $line"
done
# systemd resolves a group of devices only as the service starts, and leaves out one whose module the
# kernel has not loaded by then. So each module that makes one of the unit's groups is loaded before.
for module in usbcore videodev mc hid drm nvidia nvidia_modeset nvidia_uvm; do
  for key in Wants After; do
    grep -q "^$key=.*modprobe@$module.service" previzd.service ||
      fail "previzd.service does not load $module before it starts ($key=)"
  done
done
if grep -q '^DeviceAllow=char-input\|^SupplementaryGroups=.*input' previzd.service; then
  fail "previzd.service may read keyboards"
fi
if grep -qw input previzd.sysusers; then fail "previzd.sysusers puts the user into the group of keyboards"; fi
# systemd takes a key that it does not know for no error.
unknown=$(systemd-analyze verify --man=no ./previzd.service 2>&1 |
  grep -v 'is not executable: No such file' || true)
[[ -z $unknown ]] || fail "previzd.service: $unknown"

# The example for disks of takes: a dead one keeps neither the service from starting nor the other from
# being used, and each may be written.
disks=../config/takes-disk.conf
for line in 'Wants=mnt-a.mount mnt-b.mount' 'After=mnt-a.mount mnt-b.mount' 'ReadWritePaths=-/mnt/a -/mnt/b'; do
  grep -qx "$line" $disks || fail "takes-disk.conf has no $line"
done
if grep -q '^\(Requires\|RequiresMountsFor\|Requisite\|BindsTo\)=' $disks; then
  fail "takes-disk.conf keeps the service from starting without a disk"
fi

# The daemon's program knows the status by the same number.
grep -q 'int start_again = 75;' ../daemon/rig/service.hpp || fail "the daemon ends with another status than 75"

# No rule opens every HID device or every GPIO chip.
if grep -v '^#' 70-previzd.rules | grep -q 'hidraw\|gpio\|GROUP="input"'; then
  fail "70-previzd.rules opens devices that nobody has named"
fi
# A camera that is also a HID device is left alone; cameras alone are opened.
matches() { # the interfaces of a device, as udev knows them
  local rule opens=no
  rule=$(grep '^SUBSYSTEM=="usb"' 70-previzd.rules)
  local any none
  any=$(sed 's/.*ID_USB_INTERFACES}=="\([^"]*\)".*/\1/' <<<"$rule")
  none=$(sed 's/.*ID_USB_INTERFACES}!="\([^"]*\)".*/\1/' <<<"$rule")
  local IFS='|' pattern
  for pattern in $any; do
    # shellcheck disable=SC2053  # the right side is a pattern
    [[ $1 == $pattern ]] && opens=yes
  done
  # shellcheck disable=SC2053
  [[ $1 == $none ]] && opens=no
  [[ $opens == yes ]]
}
matches :0e0100:0e0200: || fail "a UVC camera is not opened"
matches :ef0500:ef0502: || fail "a USB3 Vision camera is not opened"
for other in :030101: :030102:030000: :080650: :0e0100:0e0200:030000: :e00101: :ff0000:; do
  if matches "$other"; then fail "$other is opened"; fi
done

# After failures in close succession a start waits longer and longer, an end in order forgets them, and
# what is broken keeps none from happening.
export RUNTIME_DIRECTORY AWAIT_RESTART_SLEEP=echo
RUNTIME_DIRECTORY=$(mktemp -d)
trap 'rm -rf "$RUNTIME_DIRECTORY"' EXIT
waited() { ./await-restart | tail -1; }
delays=$(for ((i = 0; i < 11; ++i)); do
  waited
  SERVICE_RESULT=exit-code ./await-restart ended
done | tr '\n' ' ')
[[ $delays == "0 0 0 0 1 2 4 8 16 30 30 " ]] || fail "await-restart waits $delays"
SERVICE_RESULT=success ./await-restart ended
[[ $(waited) == 0 ]] || fail "await-restart waits after a restart in order"
for broken in "" garbage "3 x" "9 999999999"; do # the last is of before the machine was started
  echo "$broken" >"$RUNTIME_DIRECTORY/failures"
  [[ $(waited) == 0 ]] || fail "await-restart waits after \"$broken\""
done
RUNTIME_DIRECTORY=/nonexistent ./await-restart >/dev/null || fail "await-restart keeps the rig from starting"
RUNTIME_DIRECTORY=/nonexistent SERVICE_RESULT=signal ./await-restart ended || fail "await-restart fails at the end"
