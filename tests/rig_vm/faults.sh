#!/usr/bin/env bash
# Brings one fault after another upon the rig in a VM, as tests/rig_vm/run.sh BUILD faults [FAULT]... does.
#   faults.sh GUEST BUILD PREVIZD.deb PREVIZ-TOOLS.deb [FAULT]...
# Prints one line a fault: whether the rig held, what was promised, and what was found; without a FAULT
# all of faults_in_guest.sh. Ends with 0 only if all held. Every fault meets the same rig, with the package
# installed and its pictures running: it is prepared once, and again when the package or what prepares it
# has changed, saved, and gone on with for each fault on fresh disks. What each leaves is in
# out/rig_vm/faults.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
here=tests/rig_vm
limit_s=900 # for one fault; ten kills and starts take half of it
guest=$(realpath "$1") build=$2 deb=$3 tools_deb=$4
known=$(sed -n 's/^promise\[\([a-z_]*\)\]=.*/\1/p' $here/faults_in_guest.sh)
faults=("${@:5}")
[[ ${#faults[@]} -gt 0 ]] || mapfile -t faults <<<"$known"
for fault in "${faults[@]}"; do
  grep -qx "$fault" <<<"$known" && continue
  echo "rig_vm: no fault \"$fault\"; there are: ${known//$'\n'/, }" >&2
  exit 2
done

# Makes a folder's disks, each of which keeps apart what is written over the disk that it stands for. What
# the guest has written and not flushed is lost with QEMU, which notes where a block went at a flush only:
# so a disk loses its cache with the power.
# make_disks FOLDER SYSTEM A B
make_disks() {
  local folder=$1 disk
  mkdir -p "$folder"
  for disk in system a b; do
    shift
    qemu-img create -q -f qcow2 -b "$(realpath "${1%:*}")" -F "${1#*:}" "$folder/$disk.qcow2" || return
  done
}

# Puts the frames of a take's lines eight times as far apart.
slow_down() {
  local line first='' now at
  while read -r line; do
    now=${line#*\"timestamp_ns\":} now=${now%%,*} first=${first:-$now} at=$((first + 8 * (now - first)))
    printf '%s\n' "${line//$now/$at}"
  done
}

prepare() {
  local share=out/rig_vm/prepare part=$machine.part disk
  rm -rf "$share" "$part"
  mkdir -p "$share" "$part"
  for disk in a b; do mke2fs -q -F -t ext4 -m 0 -L "takes_$disk" "$part/$disk.ext4" 1500m >/dev/null || return; done
  mv "$part" "$machine"
  make_disks "$machine" "$guest/root.ext4:raw" "$machine/a.ext4:raw" "$machine/b.ext4:raw" || return
  cp "$deb" "$share/previzd.deb"
  cp "$tools_deb" "$share/previz-tools.deb"
  cp "$build/tests/rig_vm/rig_vm_camera" $here/{steps.sh,prepare_in_guest.sh} config/takes-disk.conf "$share/"
  # The demo's light, an eighth as often: the emulated processor has little time for it.
  cp -r config/demo/session "$share/light"
  slow_down <config/demo/session/light.jsonl >"$share/light/light.jsonl"
  # The demo's tags and objects, from where the package puts them.
  sed -n '/^\[tracking\]/,/^# The light is what/p' "$build/systemd/package/set.toml" | sed '$d' |
    cat $here/faults.toml - >"$share/set.toml"
  $here/vm.sh -d "$machine" -s "$(realpath "$machine")/state" "$guest" "$share" 900 "bash prepare_in_guest.sh" \
    >"$share/log" 2>&1 && return
  rm -rf "$machine"
  echo "rig_vm: the rig could not be prepared; see $share/log" >&2
  return 1
}

key=$( (cat "$deb" "$build/tests/rig_vm/rig_vm_camera" "$here"/{vm.sh,prepare_in_guest.sh,faults.toml}
  echo "$guest") | sha256sum | cut -c1-16)
machine=build/rig_vm/machine.$key
if [[ ! -e $machine/state ]]; then
  rm -rf build/rig_vm/machine.*
  prepare || exit 1
  echo "rig_vm: the rig is prepared after $SECONDS s"
fi

# Runs one fault, and then, where the guest's end is a part of it, what is to be found after the next
# start (FAULT_after). Its last line begins with "found: " if all held: after a sleep the guest has no
# other way to say so.
bring() {
  local fault=$1 share=out/rig_vm/faults/$1 status=0 begin=$SECONDS
  rm -rf "$share"
  mkdir -p "$share"
  make_disks "$share/disks" "$machine/system.qcow2:qcow2" "$machine/a.qcow2:qcow2" "$machine/b.qcow2:qcow2" || return
  cp $here/{steps.sh,faults_in_guest.sh} "$share/"
  cp "$deb" "$share/previzd.deb"
  $here/vm.sh -d "$share/disks" -r "$(realpath "$machine")/state" "$guest" "$share" "$limit_s" \
    "bash faults_in_guest.sh $fault" >"$share/log" 2>&1 || status=$?
  if [[ -e $share/after.wanted && ($status == 0 || $status == 125) ]]; then
    rm -f "$share/power.cut"
    status=0
    $here/vm.sh -d "$share/disks" "$guest" "$share" "$limit_s" "bash faults_in_guest.sh ${fault}_after" >>"$share/log" 2>&1 ||
      status=$?
  fi
  rm -rf "$share/disks"
  local found
  found=$(sed -n 's/^found: //p' "$share/log" | tail -1)
  if [[ -n $found ]]; then
    printf 'held    '
  else
    printf 'FAILED  '
    found=$(sed -n 's/^rig_vm: //p' "$share/log" | head -1)
    [[ $status != 124 ]] || found="not done within $limit_s s"
    found="${found:-the guest ended} ($share/log)"
    failed+=("$fault")
  fi
  printf '%s (%d s): %s; found: %s\n' "$fault" $((SECONDS - begin)) \
    "$(sed -n "s/^promise\[$fault\]=\"\(.*\)\"/\1/p" $here/faults_in_guest.sh)" "$found"
}

failed=()
for fault in "${faults[@]}"; do bring "$fault"; done
[[ ${#failed[@]} -eq 0 ]] && exit
echo "rig_vm: ${#failed[@]} of ${#faults[@]} faults FAILED: ${failed[*]}" >&2
exit 1
