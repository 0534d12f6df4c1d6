# Runs as root in the guest that prepare_in_guest.sh has made: bash faults_in_guest.sh FAULT. The rig shows
# pictures and records nothing. Each fault is a function of its name, beside what it must keep; the one
# with "_after" runs after the guest's next start. The last line says what was found.
set -uo pipefail
. ./steps.sh
tell_more() {
  journalctl --unit=previzd --no-pager --lines=60 --output=short-monotonic
  previzctl status
  ls -l /mnt/a /mnt/b
}
declare -A promise # sed reads it, too
found() { echo "found: $*"; }

begin_take() {
  previzctl record on >/dev/null || fail "no take is begun"
  within 60 "a take has begun" another_take_than ""
  take=$(status Take)
}
another_take_than() { [[ $(status Recording) == yes && $(status TakeFrames) -ge 1 && $(status Take) != "$1" ]]; }
end_take() {
  previzctl record off
  within 60 "the take is written" is_written
}
is_written() { status_is Recording no && status_is Writing no; }
has_frames() { [[ $(status TakeFrames) -ge $1 ]]; }
# Waits until the running take has so many frames more.
frames_more() { within 120 "$1 frames more are in the take" has_frames $(($(status TakeFrames) + $1)); }
# The folder of a take; a whole path stays as it is.
take_folder() { if [[ $1 == /* ]]; then echo "$1"; else ls -d /mnt/[ab]/"$1"; fi; }
frames_in() { wc -l <"$(take_folder "$1")/observer.jsonl"; }
# These two say that all there is of a take is as it was recorded, whether it was closed or not. That the emulated processor
# was too slow for some frames, it may say.
damage_of() {
  previz takes check "$(take_folder "$1")" 2>&1 | grep -Ev ': whole, |did not reach the disk in time' | grep -Ev "$2"
}
is_sound() {
  local what
  what=$(damage_of "$1" 'was not closed') && fail "$1 is damaged: $what"
  true
}
is_whole() {
  local what
  what=$(damage_of "$1" '^$') && fail "$1 is not whole: $what"
  true
}
# The daemon has said this, in the journal.
says() { journalctl --boot --unit=previzd --output=cat --no-pager | grep -F "$1" >/dev/null; }
restarts() { systemctl show --property=NRestarts --value previzd; }
answers() { [[ -n $(status Mode) ]]; }
start_rig() {
  systemctl start previzd || fail "the service does not start"
  within 60 "the bus answers" status_is Set rig
}

promise[killed]="kill -9 at each of ten seconds of a take costs no frame that was counted; recording continues in the next take, and the cut-off one is named"
killed() {
  local second counted in_all=0 waited=0 since
  begin_take
  for second in {1..10}; do
    sleep "$second"
    take=$(status Take) counted=$(status TakeFrames)
    kill -KILL "$(main_pid)"
    since=$SECONDS
    within 90 "kill $second, $counted frames counted: the next take has begun" another_take_than "$take"
    [[ $((SECONDS - since)) -le $waited ]] || waited=$((SECONDS - since))
    [[ $(frames_in "$take") -ge $counted ]] || fail "$take has $(frames_in "$take") of $counted frames"
    says "$take was cut off" || fail "nothing says that $take was cut off"
    is_sound "$take"
    in_all=$((in_all + counted))
  done
  end_take
  is_whole "$(status Take)"
  found "all $in_all frames that ten takes had counted; at most $waited s to the next take's first frame"
}

has_device() { [[ $(status Device) == llvmpipe* ]]; }
promise[gpu_late]="without a graphics driver a take has its frames; pictures are rendered as soon as there is one, and the take goes on"
gpu_late() {
  systemctl stop previzd
  mv /usr/share/vulkan/icd.d /root/
  start_rig
  begin_take
  frames_more 4
  has_device && fail "there is a device: $(status Device)"
  mv /root/icd.d /usr/share/vulkan/
  local since=$SECONDS
  within 120 "a device is found" has_device
  local waited=$((SECONDS - since))
  advances render "pictures are rendered"
  [[ $(status Take) == "$take" ]] || fail "the take ended"
  end_take
  is_whole "$take"
  found "$(frames_in "$take") frames in one take; the device after $waited s"
}

# The PCI devices of the disks; a disk that is taken away is gone as one whose cable was pulled.
disk_device() { realpath "/sys/block/$(basename "$(realpath "/dev/disk/by-label/takes_$1")")/device/.."; }
unplug_disk() { echo 1 >"$(disk_device "$1")/remove"; }
plug_disks() {
  echo 1 >/sys/bus/pci/rescan
  udevadm settle
  systemctl start mnt-a.mount mnt-b.mount || fail "a disk is not mounted again"
}

promise[disk_late]="without the first disk the service starts and records on the second, under a number of its own; what was cut off on the first is named when it comes, and the next start records there again"
disk_late() {
  begin_take
  frames_more 3
  local cut=/mnt/a/$take counted
  counted=$(status TakeFrames)
  kill -KILL "$(main_pid)"
  systemctl stop previzd mnt-a.mount
  unplug_disk a
  local since=$SECONDS
  start_rig
  local waited=$((SECONDS - since))
  begin_take
  local there
  there=$(take_folder "$take")
  [[ $there == /mnt/b/* ]] || fail "$take is in $there"
  [[ $take != "$(basename "$cut")" ]] || fail "$take is on both disks"
  frames_more 3
  plug_disks
  within 60 "the cut-off take is named" says "$(basename "$cut") was cut off"
  [[ $(wc -l <"$cut/observer.jsonl") -ge $counted ]] || fail "$cut lacks frames"
  frames_more 1
  end_take
  is_sound "$cut"
  is_whole "$there"
  systemctl restart previzd
  within 60 "the bus answers" status_is Set rig
  begin_take
  [[ $(take_folder "$take") == /mnt/a/* ]] || fail "$take is in $(take_folder "$take")"
  found "the service after $waited s, $there; $cut of the late disk named; $take on it after a restart"
}

# Leaves so many MB of a disk above what takes leave free (512 MB).
fill_disk() {
  local free
  free=$(df --output=avail -B1M "/mnt/$1" | tail -1)
  fallocate -l $((free - 512 - $2))M "/mnt/$1/filled"
}

promise[disk_full]="a take goes on on the second disk before the first is full; when both are, it ends in order, with the reason; nothing is lost, and with space there is a take again"
disk_full() {
  fill_disk a 24
  fill_disk b 24
  begin_take
  [[ $(take_folder "$take") == /mnt/a/* ]] || fail "$take is in $(take_folder "$take")"
  within 200 "the next take is on the second disk" another_take_than "$take"
  local first=$take second
  second=$(status Take)
  [[ $(take_folder "$second") == /mnt/b/* ]] || fail "$second is in $(take_folder "$second")"
  is_whole "$first"
  within 200 "it ends when both are full" status_is Recording no
  within 60 "it is written" is_written
  local why
  why=$(status Fault)
  [[ -n $why ]] || fail "there is no reason"
  is_whole "$second"
  rm /mnt/a/filled /mnt/b/filled
  begin_take
  frames_more 1
  end_take
  is_whole "$take"
  found "$first and $second whole, \"$why\", then $take"
}

promise[disk_pulled]="when the disk of a running take is pulled out, the next take begins on the second one; what was on the disk a second before is there when it is back"
disk_pulled() {
  begin_take
  frames_more 6
  local first=$take counted since
  counted=$(status TakeFrames)
  sleep 2 # twice the second within which a frame is to be on the disk
  unplug_disk a
  since=$SECONDS
  within 60 "the next take has begun" another_take_than "$first"
  local waited=$((SECONDS - since))
  take=$(status Take)
  [[ $(take_folder "$take") == /mnt/b/* ]] || fail "$take is in $(take_folder "$take")"
  frames_more 3
  end_take
  is_whole "$take"
  umount --lazy /mnt/a
  plug_disks
  [[ $(frames_in "$first") -ge $counted ]] || fail "$first has $(frames_in "$first") of $counted frames"
  is_sound "$first"
  found "$(frames_in "$first") frames of $first, of which $counted were to be there; $take after $waited s"
}

promise[disk_hung]="while the disk stands still for a minute, the rig answers, shows pictures and says so, and is not started anew; afterwards the take has every frame, or counts it"
disk_hung() {
  systemctl stop previzd mnt-a.mount
  local disk
  disk=$(realpath /dev/disk/by-label/takes_a)
  dmsetup create takes --table "0 $(blockdev --getsz "$disk") linear $disk 0" || fail "no device mapper"
  mount /dev/mapper/takes /mnt/a
  start_rig
  within 300 "pictures are drawn" has_drawn 3
  begin_take
  frames_more 4
  local pid before captured
  pid=$(main_pid) before=$(metric '.stages.display.frames') captured=$(metric '.stages.observer.frames')
  local counted
  counted=$(status TakeFrames)
  dmsetup suspend --noflush --nolockfs takes
  local until=$((SECONDS + 60)) slowest=0 since
  while [[ $SECONDS -lt $until ]]; do
    since=$SECONDS
    answers || fail "the bus does not answer"
    [[ $((SECONDS - since)) -le $slowest ]] || slowest=$((SECONDS - since))
    sleep 2
  done
  says "the disk does not respond" || fail "nothing says that the disk does not respond"
  dmsetup resume takes
  within 60 "the disk responds again" says "the disk responds again"
  [[ $(main_pid) == "$pid" && $(restarts) == 0 ]] || fail "the rig was started anew"
  # Few, since what draws on the processor leaves it to a recording that is behind.
  local shown=$(($(metric '.stages.display.frames') - before))
  [[ $shown -gt 0 ]] || fail "no picture was shown meanwhile"
  frames_more 2
  captured=$(($(metric '.stages.observer.frames') - captured))
  local there=$(($(status TakeFrames) - counted)) dropped
  dropped=$(status TakeDropped)
  end_take
  is_whole "$(status Take)"
  [[ $((there + dropped)) -ge $((captured - 3)) ]] || fail "of $captured frames $there are there and $dropped counted"
  found "$shown pictures meanwhile, answers within $((slowest + 1)) s; of $captured frames $there in $(status Take), $dropped of both cameras counted"
}

promise[bus_restarted]="when the message bus is started anew, the rig is on it again by itself, and the take goes on"
bus_restarted() {
  begin_take
  frames_more 2
  local pid since=$SECONDS
  pid=$(main_pid)
  systemctl restart dbus
  within 60 "the rig is on the bus again" status_is Take "$take"
  local waited=$((SECONDS - since))
  frames_more 4
  [[ $(main_pid) == "$pid" ]] || fail "the rig was started anew"
  end_take
  is_whole "$take"
  found "on the bus after $waited s; $(frames_in "$take") frames in one take"
}

promise[shutdown]="in mid-take a shutdown that respects others is refused; one that is forced closes the take, and the next start records on"
shutdown() {
  begin_take
  frames_more 3
  within 30 "the rig holds shutdowns off" inhibits shutdown
  systemctl --check-inhibitors=yes poweroff 2>&1 && fail "the machine shuts down"
  [[ $(systemctl is-system-running) != stopping ]] || fail "the machine stops"
  frames_more 3
  echo "$take $(status TakeFrames)" >taken
  touch after.wanted
  sync
  systemctl poweroff -i
  sleep 60 # in which this script is ended
}
# Whether the rig holds off this: shutdown or sleep.
inhibits() { systemd-inhibit --list --no-legend | grep "^previzd.* $1 .*block" >/dev/null; }
shutdown_after() {
  local counted
  read -r take counted <taken
  is_whole "$take"
  [[ $(frames_in "$take") -ge $counted ]] || fail "$take has $(frames_in "$take") of $counted frames"
  within 120 "the next start records on" another_take_than "$take"
  found "refused, then $take closed with $(frames_in "$take") frames, of which $counted had been counted; then $(status Take)"
}

promise[upgraded]="an upgrade of the package leaves the running take alone; the new version starts by itself when somebody ends the take"
upgraded() {
  begin_take
  frames_more 2
  local pid
  pid=$(main_pid)
  dpkg --force-confold --install previzd.deb || fail "the package is not upgraded"
  frames_more 4
  [[ $(main_pid) == "$pid" && $(status Take) == "$take" ]] || fail "the upgrade ended the take"
  previzctl record off
  local since=$SECONDS
  is_new() { [[ $(main_pid) -gt 0 && $(main_pid) != "$pid" ]] && status_is Set rig; }
  within 120 "the new version runs" is_new
  is_whole "$take"
  status_is Recording no || fail "it records, although the take was ended"
  found "$(frames_in "$take") frames in one take; the new version $((SECONDS - since)) s after its end"
}

promise[clock_stepped]="steps of the clock by 10 s, forward and back, move no stamp of a frame, of either camera"
# Prints the least and the most, in seconds, of what jq makes of a take's lines.
range_of() { jq -s -r "$2 | map(. / 1e9) | \"\(min) \(max)\"" "$(take_folder "$take")/$1.jsonl"; }
within_range() { awk -v range="$1" -v low="$2" -v high="$3" 'BEGIN { split(range, s, " "); exit !(s[1] >= low && s[2] <= high) }'; }
# A stamp is no later than the arrival, and older by 1.3 s and a frame (0.5 s) at most, whatever the camera's
# clock says (ClockMap.AHostileClockDoesNoHarm). Leaves the range in "age".
film_stamps_fit() {
  age=$(range_of observer 'map(.arrival_ns - .timestamp_ns)')
  within_range "$age" 0 1.8 || fail "frames of the film camera are said to be $age s old"
}
clock_stepped() {
  begin_take
  frames_more 4
  date --set='+10 seconds' >/dev/null
  frames_more 4
  date --set='-10 seconds' >/dev/null
  frames_more 8
  end_take
  is_whole "$take"
  # The film camera, Aravis' own, sends by the wall clock: a step may hold it up, and it stamps by it.
  local age gaps
  film_stamps_fit
  gaps=$(range_of light '[.[].timestamp_ns] | [.[1:], .[:-1]] | transpose | map(.[0] - .[1])')
  # The light camera sends a frame every 0.32 s, and some come late on an emulated processor; a step that
  # got through would make 10 s of one gap, or turn one round.
  within_range "$gaps" 0.001 5 || fail "the light camera's stamps jump: $gaps s"
  found "$(frames_in "$take") frames of the film camera ${age/ / to } s before they came, those of the light camera ${gaps/ / to } s apart"
}

promise[suspended]="the machine is not put to sleep while others respect the take; where it is forced to, the cameras are back afterwards, the take goes on, and no stamp lies in the future"
suspended() {
  begin_take
  frames_more 3
  within 30 "the rig holds sleep off" inhibits sleep
  systemctl --check-inhibitors=yes suspend 2>&1 && fail "the machine sleeps"
  local pid
  pid=$(main_pid)
  # The host's folder, which is virtio's, does not outlive this: what follows has nothing to do with it,
  # and ends the guest by itself.
  cd /root || exit
  umount --lazy /rig
  rtcwake --mode mem --seconds 10 || fail "the machine does not sleep"
  frames_more 4
  [[ $(main_pid) == "$pid" && $(status Take) == "$take" ]] || fail "the sleep ended the take"
  end_take
  is_whole "$take"
  local age
  film_stamps_fit
  found "$(frames_in "$take") frames in one take, ${age/ / to } s before they came"
  sleep 2 # until the host has that
  echo o >/proc/sysrq-trigger
  sleep 60 # which the power does not outlast
}

promise[power_cut]="with the power goes at most the last second of a take; the next start names it and records on"
power_cut() {
  begin_take
  (
    while sleep 0.3; do echo "$(cut -d' ' -f1 /proc/uptime) $take $(status TakeFrames)" >>counted; done
  ) &
  frames_more 6
  sleep "$((RANDOM % 4)).$((RANDOM % 10))"
  touch after.wanted
  # The disk is to lose what it is not told to keep, so that something is shown: a place that no file has.
  head -c 65536 /dev/zero | tr '\0' x |
    dd of="$(realpath /dev/disk/by-label/takes_b)" bs=64k seek=20000 oflag=direct status=none
  cut -d' ' -f1 /proc/uptime >cut_at
  touch power.cut
  sleep 60 # which the power does not outlast
}
power_cut_after() {
  local counted had
  [[ $(dd if="$(realpath /dev/disk/by-label/takes_b)" bs=64k skip=20000 count=1 status=none | tr -d '\0' | wc -c) == 0 ]] ||
    fail "the disk kept what it was not told to keep, so that nothing is shown"
  # A second before the power went.
  read -r take counted < <(awk -v cut="$(cat cut_at)" '$1 < cut - 1 { take = $2; n = $3 } END { print take, n }' counted)
  had=$(tail -1 counted | cut -d' ' -f3)
  within 120 "the next start records on" another_take_than "$take"
  [[ $(frames_in "$take") -ge $counted ]] || fail "$take has $(frames_in "$take") frames; $counted were there a second before"
  says "$take was cut off" || fail "nothing says that $take was cut off"
  is_sound "$take"
  found "$(frames_in "$take") frames of $take; $counted were counted a second before, $had at the end; then $(status Take)"
}

[[ $(type -t "$1") == function ]] || fail "no fault $1"
"$1"
