#!/usr/bin/env bash
# Runs a shell command in the guest that guest/build.sh has built, and ends with its status.
#   vm.sh [-d DISKS] [-s STATE | -r STATE] GUEST SHARE SECONDS 'command'
#     -d  a folder with system.qcow2, a.qcow2 and b.qcow2: the guest's disks, which keep what it writes.
#         Without it the guest writes into its memory, and nothing is kept.
#     -s  saves the running guest in a file when the command has ended with 0
#     -r  goes on with a guest that was saved so, on the disks as they were then
# SHARE is /rig in the guest and the command's working directory; what its screen shows is put into
# SHARE/screen.ppm when SHARE/screen.wanted comes into being. When SHARE/power.cut does, the guest's
# power goes at once, and with it what its disks were not told to keep; the status is 0. In SHARE/.run
# are left: output, status, console, dmesg, journal. The sockets SHARE/.run/usb0 and usb1 are two ports
# of its USB (usbredir). Needs no KVM; no right but to read GUEST.
set -euo pipefail
disks='' save='' resume=''
while getopts d:s:r: option; do
  case $option in
  d) disks=$OPTARG ;;
  s) save=$OPTARG ;;
  r) resume=$OPTARG ;;
  *) exit 2 ;;
  esac
done
shift $((OPTIND - 1))
guest=$1 share=$(realpath "$2") limit=$3
run=$share/.run
rm -rf "$run"
mkdir "$run"
mkfifo "$run/monitor.in" "$run/monitor.out" "$run/go"
printf '%s\n' "$4" >"$run/command"
[[ -z $save ]] || touch "$run/save"
exec {go}<>"$run/go"
echo go >&"$go"

keep='' drives=(-drive "file=$guest/root.ext4,format=raw,if=virtio,readonly=on")
if [[ -n $disks ]]; then
  keep=rig.keep drives=()
  for disk in system a b; do drives+=(-drive "file=$disks/$disk.qcow2,format=qcow2,if=virtio"); done
fi
[[ -z $resume ]] || drives+=(-incoming "exec:cat '$resume'")

# The guest is saved while it stands still, since QEMU's own processor changes memory behind the back of
# whoever copies it, and runs at once where it is gone on with: hence no global state.
# no_timer_check: on a busy host the emulated timer comes too late for the kernel's test of it.
timeout --foreground "$limit" qemu-system-x86_64 -M q35 -accel tcg,thread=multi,tb-size=512 \
  -cpu max -smp 2 -m 2048 -nodefaults -no-user-config -no-reboot -display none \
  -kernel "$guest/vmlinuz" -initrd "$guest/initrd.gz" \
  -append "console=ttyS0 quiet loglevel=4 systemd.show_status=0 mitigations=off audit=0 panic=-1 no_timer_check net.ifnames=0 $keep" \
  "${drives[@]}" -global migration.store-global-state=off \
  -virtfs "local,path=$share,mount_tag=rig,security_model=none,multidevs=remap" \
  -device virtio-serial-pci \
  -chardev "file,id=out,path=$run/output" -device virtserialport,chardev=out,name=rig.out \
  -chardev "pipe,id=go,path=$run/go" -device virtserialport,chardev=go,name=rig.go \
  -serial "file:$run/console" -monitor "pipe:$run/monitor" \
  -device qemu-xhci,id=usb \
  -chardev "socket,id=usb0,path=$run/usb0,server=on,wait=off" -device usb-redir,chardev=usb0,bus=usb.0 \
  -chardev "socket,id=usb1,path=$run/usb1,server=on,wait=off" -device usb-redir,chardev=usb1,bus=usb.0 \
  -vga none -device virtio-gpu-pci,xres=640,yres=400 -device virtio-rng-pci </dev/null &
qemu=$!
cat "$run/monitor.out" >/dev/null &
comes() { until "$@" 2>/dev/null; do sleep 0.2; done; }
(
  comes test -e "$share/screen.wanted"
  echo "screendump $share/screen.part" >"$run/monitor.in"
  comes test -s "$share/screen.part"
  sleep 2 # until it is written to its end
  mv "$share/screen.part" "$share/screen.ppm"
) &
(
  comes test -e "$share/power.cut"
  # The children of timeout: QEMU alone.
  pkill -KILL -P "$qemu"
) &
(
  # QEMU does not notice that a guest is off which has slept; the others are gone by then.
  comes grep -q 'reboot: Power down' "$run/console"
  sleep 3
  echo quit >"$run/monitor.in"
) &
if [[ -n $save ]]; then
  (
    comes grep -q '^rig: at rest' "$run/console"
    [[ $(cat "$run/status") == 0 ]] &&
      printf 'stop\nmigrate "exec:cat >%s"\n' "'$save.part'" >"$run/monitor.in"
    echo quit >"$run/monitor.in"
  ) &
fi
helpers=$(jobs -p | tail -n +2 | tr '\n' ' ')
# shellcheck disable=SC2064,SC2086
trap "kill $qemu $helpers >/dev/null 2>&1 || true" EXIT
tail -q -f -s 0.2 -n +1 --retry --pid=$qemu "$run/output" 2>/dev/null || true
status=0
wait $qemu || status=$?
[[ -e $share/power.cut ]] && exit 0
[[ -z $save || ! -e $save.part ]] || mv "$save.part" "$save"
[[ -s $run/status ]] && exit "$(cat "$run/status")"
echo "vm.sh: the guest ended without a status (QEMU: $status); the end of $run/console:" >&2
tail -5 "$run/console" >&2 || true
[[ $status -eq 124 ]] && exit 124
exit 125
