#!/usr/bin/env bash
# The rig in a VM: installs the package in a Debian 12 guest and runs the daemon there as its users
# do, under systemd, on real device nodes with simulated hardware behind them. Presses buttons,
# unplugs and replugs every device, and checks what the recorder and the metrics say of it.
#   tests/rig_vm/run.sh [BUILD]         BUILD: a build folder that is there (default: build/release)
# The guest is built the first time, and when what the package depends on or guest/ has changed: as
# root, six minutes and the network. The run itself takes ten minutes, thirteen on two busy cores, for
# the guest's processor is emulated. What it leaves is in out/rig_vm.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/rig_vm
build=${1:-build/release}
share=out/rig_vm
limit_s=3000

for tool in qemu-system-x86_64 mmdebstrap mke2fs cpio busybox; do
  command -v "$tool" >/dev/null && continue
  echo "rig_vm: $tool is missing; apt-get install qemu-system-x86 mmdebstrap e2fsprogs cpio" \
    "busybox-static linux-headers-amd64 xz-utils make gcc" >&2
  exit 1
done

[[ -e $build/CMakeCache.txt ]] || cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release
cmake --build "$build" --parallel "$(nproc)" --target deb rig_vm_devices
deb=$(ls "$build"/previzd_*.deb)

key=$( (dpkg-deb --field "$deb" Depends; cat "$here"/guest/*) | sha256sum | cut -c1-16)
guest=${PREVIZ_RIG_VM_CACHE:-build/rig_vm}/$key
if [[ ! -e $guest/root.ext4 ]]; then
  "$here/guest/build.sh" "$deb" "$guest.part"
  rm -rf "$guest"
  mv "$guest.part" "$guest"
fi

rm -rf "$share"
mkdir -p "$share"
cp "$deb" "$share/previzd.deb"
cp "$build"/tests/rig_vm/rig_vm_{camera,pad} "$here/in_guest.sh" "$share/"
cp "$here/rig.toml" "$share/rig.toml"
# The demo's tags and objects, from where the package puts them.
sed -n '/^\[tracking\]/,/^# The light is what/p' "$build/systemd/package/set.toml" | sed '$d' >>"$share/rig.toml"

if "$here/vm.sh" "$guest" "$share" "$limit_s" 'bash in_guest.sh'; then
  echo "rig_vm: passed in $SECONDS s"
else
  echo "rig_vm: FAILED; $share/.run has the journal" >&2
  exit 1
fi
