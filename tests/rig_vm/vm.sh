#!/usr/bin/env bash
# Runs a shell command in the guest that guest/build.sh has built, and ends with its status.
#   vm.sh GUEST SHARE SECONDS 'command'
# SHARE is /rig in the guest and the command's working directory; what its screen shows is put into
# SHARE/screen.ppm when SHARE/screen.wanted comes into being. In SHARE/.run are left: output, status,
# console, dmesg, journal. The sockets SHARE/.run/usb0 and usb1 are two ports of its USB (usbredir).
# Nothing that the guest writes elsewhere is kept. Needs no KVM; no right but to read GUEST.
set -euo pipefail
guest=$1 share=$(realpath "$2") limit=$3
run=$share/.run
rm -rf "$run"
mkdir "$run"
mkfifo "$run/monitor.in" "$run/monitor.out"
printf '%s\n' "$4" >"$run/command"

# no_timer_check: on a busy host the emulated timer comes too late for the kernel's test of it.
timeout --foreground "$limit" qemu-system-x86_64 -M q35 -accel tcg,thread=multi,tb-size=512 \
  -cpu max -smp 2 -m 2048 -nodefaults -no-user-config -no-reboot -display none \
  -kernel "$guest/vmlinuz" -initrd "$guest/initrd.gz" \
  -append "console=ttyS0 quiet loglevel=4 systemd.show_status=0 mitigations=off audit=0 panic=-1 no_timer_check net.ifnames=0" \
  -drive "file=$guest/root.ext4,format=raw,if=virtio,readonly=on" \
  -virtfs "local,path=$share,mount_tag=rig,security_model=none,multidevs=remap" \
  -device virtio-serial-pci \
  -chardev "file,id=out,path=$run/output" -device virtserialport,chardev=out,name=rig.out \
  -serial "file:$run/console" -monitor "pipe:$run/monitor" \
  -device qemu-xhci,id=usb \
  -chardev "socket,id=usb0,path=$run/usb0,server=on,wait=off" -device usb-redir,chardev=usb0,bus=usb.0 \
  -chardev "socket,id=usb1,path=$run/usb1,server=on,wait=off" -device usb-redir,chardev=usb1,bus=usb.0 \
  -vga none -device virtio-gpu-pci,xres=640,yres=400 -device virtio-rng-pci </dev/null &
qemu=$!
cat "$run/monitor.out" >/dev/null &
(
  until [[ -e $share/screen.wanted ]]; do sleep 0.5; done
  echo "screendump $share/screen.part" >"$run/monitor.in"
  until [[ -s $share/screen.part ]]; do sleep 0.5; done
  sleep 2 # until it is written to its end
  mv "$share/screen.part" "$share/screen.ppm"
) &
helpers=$(jobs -p | tail -n +2 | tr '\n' ' ')
# shellcheck disable=SC2064,SC2086
trap "kill $qemu $helpers >/dev/null 2>&1 || true" EXIT
tail -q -f -s 0.2 -n +1 --retry --pid=$qemu "$run/output" 2>/dev/null || true
status=0
wait $qemu || status=$?
[[ -s $run/status ]] && exit "$(cat "$run/status")"
echo "vm.sh: the guest ended without a status (QEMU: $status); the end of $run/console:" >&2
tail -5 "$run/console" >&2 || true
[[ $status -eq 124 ]] && exit 124
exit 125
