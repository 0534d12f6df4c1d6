#!/usr/bin/env bash
# previzd in a VM, a Debian 12 guest with real device nodes and simulated hardware behind them.
#   tests/rig_vm/run.sh [BUILD [PART]...]
#   tests/rig_vm/run.sh BUILD faults [FAULT]...
#     BUILD: a build folder, made where it is not there (default: build/release)
#     PART (default: all):
#       drivers   every driver on the kernel's own devices, unplugged a hundred times
#       rig       the package and its daemon under systemd: a take, buttons, every device unplugged
#       faults    what befalls a rig while it records, the shipped service unchanged: kills, disks
#                 that are late, full, pulled out or stand still, a power cut, and others
#                 (faults_in_guest.sh); with a FAULT that one alone
# The guest is built the first time, and when what the package depends on or guest/ has changed: as
# root, six minutes and the network. The guest's processor is emulated: "drivers" takes twenty
# minutes, "rig" nine, eighteen on two busy cores, "faults" twenty. What they leave is in out/rig_vm.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/rig_vm
build=${1:-build/release}
parts=("${@:2}") faults=()
[[ ${#parts[@]} -gt 0 ]] || parts=(drivers rig faults)
[[ ${parts[0]} != faults ]] || faults=("${parts[@]:1}") parts=(faults)
for part in "${parts[@]}"; do
  [[ $part == drivers || $part == rig || $part == faults ]] && continue
  echo "rig_vm: no part \"$part\"; there are drivers, rig and faults" >&2
  exit 2
done
limit_s=3000

for tool in qemu-system-x86_64 qemu-img mmdebstrap mke2fs cpio busybox; do
  command -v "$tool" >/dev/null && continue
  echo "rig_vm: $tool is missing; apt-get install qemu-system-x86 qemu-utils mmdebstrap e2fsprogs cpio" \
    "busybox-static linux-headers-amd64 xz-utils make gcc" >&2
  exit 1
done

[[ -e $build/CMakeCache.txt ]] || cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release
# The gate leaves out of a build folder the programs that only the full run runs.
cmake "$build" --log-level=WARNING -DPREVIZ_GATE=OFF >/dev/null
suites=(camera_compliance replug usb buttons display_devices)
cmake --build "$build" --parallel "$(nproc)" --target deb rig_vm_devices previzd "${suites[@]/#/test_}"
deb=$(ls "$build"/previzd_*.deb) tools_deb=$(ls "$build"/previz-tools_*.deb)

key=$( (dpkg-deb --field "$deb" Depends; dpkg-deb --field "$tools_deb" Depends; cat "$here"/guest/*) | sha256sum | cut -c1-16)
guest=${PREVIZ_RIG_VM_CACHE:-build/rig_vm}/$key
if [[ ! -e $guest/root.ext4 ]]; then
  "$here/guest/build.sh" "$guest.part" "$deb" "$tools_deb"
  rm -rf "$guest"
  mv "$guest.part" "$guest"
fi

usb=()
unplug_all() {
  [[ ${#usb[@]} -eq 0 ]] || kill "${usb[@]}" 2>/dev/null || true
  wait "${usb[@]}" 2>/dev/null || true
  usb=()
}
trap unplug_all EXIT

# Runs PART_in_guest.sh in the guest, in SHARE. The files usb_camera and pad/cable there plug in its
# USB devices.
run_part() {
  local part=$1 share=$2 passed=true
  cp "$build"/tests/rig_vm/rig_vm_{camera,pad} "$here"/{steps.sh,"${part}_in_guest.sh"} "$share/"
  "$build/tests/rig_vm/rig_vm_usb_camera" "$share/.run/usb0" "$share/usb_camera" \
    config/demo/session 10 &
  usb+=($!)
  "$build/tests/rig_vm/rig_vm_usb_pad" "$share/.run/usb1" "$share/pad/cable" &
  usb+=($!)
  "$here/vm.sh" "$guest" "$share" "$limit_s" "bash ${part}_in_guest.sh" || passed=false
  unplug_all
  if ! $passed; then
    echo "rig_vm: $part FAILED; $share/.run has the journal" >&2
    exit 1
  fi
  echo "rig_vm: $part passed after $SECONDS s"
}

for part in "${parts[@]}"; do
  if [[ $part == faults ]]; then
    "$here/faults.sh" "$guest" "$build" "$deb" "$tools_deb" "${faults[@]}"
    continue
  fi
  share=out/rig_vm/$part
  rm -rf "$share"
  mkdir -p "$share"
  case $part in
  drivers)
    cp -r "$build/libexec" "$build/daemon/previzd" systemd/70-previzd.rules \
      "${suites[@]/#/$build/tests/devices/test_}" "$share/"
    ;;
  rig)
    cp "$deb" "$share/previzd.deb"
    # The demo's tags and objects, from where the package puts them.
    sed -n '/^\[tracking\]/,/^# The light is what/p' "$build/systemd/package/set.toml" | sed '$d' >"$share/demo.toml"
    for light in usb vivid; do
      cat "$here/rig.toml" "$here/light_$light.toml" "$share/demo.toml" >"$share/rig_$light.toml"
    done
    ;;
  esac
  run_part "$part" "$share"
done
