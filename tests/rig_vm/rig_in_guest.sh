# Runs as root in the guest, in the folder that run.sh has filled. The package is the shipped one, but
# an emulated processor cannot keep up with what it ships: the watchdog waits for 600 and then 100 s
# instead of 20 (slow.conf), the film camera sends 2 pictures of 320x240 a second, and a take has no
# pre-roll and a queue of 64 MB (rig.toml). Nothing here shows that the shipped values go together.
set -uo pipefail
. ./steps.sh
tell_more() {
  journalctl --unit=previzd --no-pager --lines=40 --output=cat
  previzctl status
}
tap() {
  rig-devices press "$1"
  sleep 0.3
  rig-devices release "$1"
}
pad() { echo "$*" >&"$pad"; }
# The kernel's own switch of a connector ("off", "detect"), and its word that something has changed.
screen() {
  echo "$1" >/sys/class/drm/card0-Virtual-1/status
  echo change >/sys/class/drm/card0/uevent
}

# To be read on the host while the guest runs: what the daemon says.
journalctl --follow --unit=previzd --output=short-monotonic >journal.txt &

step "devices"
rig-devices vivid
rig-devices gpio
modprobe uhid
touch usb_camera
coproc PAD { ./rig_vm_pad; }
pad=${PAD[1]}
camera() { ./rig_vm_camera /usr/share/previzd/demo/session 2 & camera=$!; }

step "the set names the light camera as it is found"
dpkg-deb --extract previzd.deb unpacked
found() { unpacked/usr/bin/previzd devices 2>/dev/null | sed -n 's/.*driver = "libcamera", device = "\([^"]*\)".*/\1/p'; }
is_found() { [[ -n $(found) ]]; }
within 60 "the USB camera is found" is_found
usb_camera=$(found)
set=$(<rig_usb.toml)
mkdir -p /etc/previzd /etc/systemd/system/previzd.service.d
printf '%s\n' "${set/USB_CAMERA/"$usb_camera"}" >/etc/previzd/set.toml
grep -qF "$usb_camera" /etc/previzd/set.toml || fail "the set does not name the camera"

step "install: the service starts by itself"
# Compiling the shaders alone, at the first frame, takes minutes here.
printf '[Service]\nWatchdogSec=600\nTimeoutStartSec=600\nEnvironment=LP_NATIVE_VECTOR_WIDTH=128\n' \
  >/etc/systemd/system/previzd.service.d/slow.conf
foreign=$(stat -c '%n %G %a' /dev/hidraw* /dev/gpiochip*)
dpkg --force-confold --install previzd.deb || fail "the package does not install"
udevadm settle
[[ $(stat -c '%n %G %a' /dev/hidraw* /dev/gpiochip*) == "$foreign" ]] ||
  fail "the package opened a button that nobody has named"
# The crew names its pad and its chip.
previzd devices --rules >rules.txt
grep -E '"\*:1209:0001\.\*"|gpio-sim' rules.txt >/etc/udev/rules.d/71-previzd-buttons.rules
udevadm control --reload
udevadm trigger --settle --subsystem-match=hidraw --subsystem-match=gpio
[[ $(stat -c %G /dev/hidraw* /dev/gpiochip* | sort -u) == *previz* ]] || fail "the printed rules open no button"
systemctl is-active --quiet previzd || fail "the service does not run"
[[ $(stat -c '%U %a' /var/lib/previzd) == "previz 750" ]] || fail "/var/lib/previzd is open to others"
within 60 "the bus answers" status_is Set rig
within 60 "a camera that is not there is reported" status_is CameraLost yes

step "the film camera is plugged in"
camera
within 600 "frames are shown" above '.stages.display.frames' 0
status_is CameraLost no || fail "the camera is still reported as lost"
advances render "rendering goes on"
advances lighting "the light camera lights the scene"

step "the screen"
for page in one another; do advances screen "it shows $page page"; done # the second has a picture
touch screen.wanted
within 60 "it is photographed" test -s screen.ppm
lit=$(tr -d '\0' <screen.ppm | wc -c)
all=$(wc -c <screen.ppm)
echo "   $lit of $all bytes are not black"
[[ $lit -gt $((all / 4)) ]] || fail "nothing is on the screen"

step "who may operate the rig"
useradd --groups previz anna
useradd --groups previz-view ben
as() { local user=$1 && shift && setpriv --reuid="$user" --regid=nogroup --init-groups "$@"; }
for order in "mode live" "record on" "action move_left" "action reload_set" "set next" metrics status; do
  # shellcheck disable=SC2086
  as nobody previzctl $order 2>/dev/null && fail "everybody may: $order"
done
for order in metrics status; do as ben previzctl $order >/dev/null || fail "previz-view may not look: $order"; done
as ben previzctl mode live 2>/dev/null && fail "previz-view operates the rig"
as anna previzctl mode live || fail "the group previz may not"
journalctl --boot --unit=previzd --no-pager | grep "bus, anna" >/dev/null || fail "the journal does not say who switched to live"
journalctl --boot --unit=previzd --no-pager | grep "bus, ben.*not allowed" >/dev/null || fail "the journal does not say who was denied"
# Every method, with an argument that none takes: who may call it hears of that, and nothing is done.
wrong() { "$@" busctl call org.previz.Rig1 /org/previz/Rig1 org.previz.Rig1 "$method" u 0 2>&1; }
methods=$(busctl --xml-interface introspect org.previz.Rig1 /org/previz/Rig1 |
  sed -n '/<interface name="org.previz.Rig1">/,/<\/interface>/s/.*<method name="\([^"]*\)".*/\1/p')
[[ $(wc -w <<<"$methods") -gt 40 ]] || fail "the rig has hardly a method: $methods"
for method in $methods; do
  [[ $(wrong as nobody) == *[Aa]ccess* ]] || fail "everybody may: $method"
  [[ $(wrong as anna) == *expecting* ]] || fail "the group previz may not: $method"
  [[ $(wrong) == *expecting* ]] || fail "root may not: $method"
done

step "buttons: contacts and a pad"
samples=$(status Samples)
tap 1
within 60 "a contact starts a take" status_is Recording yes
pad press 1
pad release 1
within 60 "the pad changes the samples" status_is Samples $((samples + 1))
take_grows() { [[ $(status TakeFrames) -ge 5 ]]; }
within 240 "five frames are in the take" take_grows

step "the light camera is unplugged while recording, and comes back"
trouble=$(metric '.counts."light camera: device trouble"')
rm usb_camera
within 120 "it is missed" above '.counts."light camera: device trouble"' "$trouble"
advances render "the picture goes on without it"
touch usb_camera
advances "light camera" "it delivers again"
status_is Recording yes || fail "the take ended with the light camera"

step "the light camera is wedged while recording, and is reset"
touch usb_camera.wedged
is_reset() { [[ ! -e usb_camera.wedged ]]; }
within 240 "it is reset" is_reset
advances "light camera" "it delivers again"
status_is Recording yes || fail "the take ended with the light camera"

step "the film camera is unplugged while recording, and comes back"
kill "$camera"
wait "$camera"
within 120 "it is missed" status_is CameraLost yes
camera
within 240 "it is back" status_is CameraLost no
advances display "frames are shown again"
status_is Recording yes || fail "the take ended with the film camera"

step "the screen is unplugged while recording, and comes back"
trouble=$(metric '.counts."screen: device trouble"')
screen off
within 60 "it is missed" above '.counts."screen: device trouble"' "$trouble"
advances display "the pictures go on without it"
screen detect
advances screen "they are on it again"
status_is Recording yes || fail "the take ended with the screen"

step "the pad is unplugged, and comes back"
pad unplug
within 60 "it is missed" above '.devices."hid:1209:0001:RIG0001".lost' 0
pad plug
samples=$(status Samples)
pad_works() {
  pad press 1
  pad release 1
  sleep 2
  [[ $(status Samples) -gt $samples ]]
}
within 60 "its button works" pad_works

step "the take"
tap 1
within 120 "a contact ends the take" status_is Recording no
take=/var/lib/previzd/takes/$(status Take)
[[ -z $(status Fault) ]] || fail "the take ended by itself: $(status Fault)"
frames=$(status TakeFrames)
cp -r "$take" take
cp /run/previzd/picture.png .
lines=$(wc -l <"$take/observer.jsonl")
lights=$(wc -l <"$take/light.jsonl")
echo "   $frames frames: $lines of the film camera, $lights of the light camera"
[[ $lines -ge 5 && $lights -ge 1 ]] || fail "the take is not complete"
grep -q '"record"\|button1' "$take/events.jsonl" || fail "the take has no event of the button"
previzctl metrics >metrics.json

step "an upgrade waits for the end of the take"
pid=$(main_pid)
tap 1
within 60 "a take runs" status_is Recording yes
dpkg --force-confold --install previzd.deb || fail "the package is not upgraded"
sleep 5
[[ $(main_pid) == "$pid" ]] || fail "the upgrade ended the take"
status_is Recording yes || fail "the upgrade ended the take"
tap 1
is_new() { [[ $(main_pid) -gt 0 && $(main_pid) != "$pid" ]] && systemctl is-active --quiet previzd; }
within 300 "the new version starts when the take has ended" is_new
within 300 "it shows frames" above '.stages.display.frames' 0
status_is Recording no || fail "it records, although the take was ended"

step "another light camera, by another set while the daemon runs"
sed 's/^name = "rig"$/name = "other"/' rig_vivid.toml >/etc/previzd/set.toml
within 120 "the set is taken" status_is Set other
advances "light camera" "it delivers"
advances lighting "it lights the scene"

step "a stop and a start: in order, and as soon as the shaders are known"
systemctl stop previzd
[[ $(systemctl show --property=Result --value previzd) == success ]] || fail "it did not end in order"
sed -i 's/WatchdogSec=.*/WatchdogSec=100/' /etc/systemd/system/previzd.service.d/slow.conf
systemctl daemon-reload
systemctl start previzd
within 300 "it shows frames again" above '.stages.display.frames' 0

step "a daemon that stands still is started anew"
kill -STOP "$(systemctl show --property=MainPID --value previzd)"
restarted() { [[ $(systemctl show --property=NRestarts --value previzd) -eq 1 ]]; }
within 300 "the watchdog has ended it" restarted
within 300 "it shows frames again" above '.stages.display.frames' 0

step "purge"
dpkg --purge previzd
[[ ! -e /etc/previzd && ! -e /usr/bin/previzd ]] || fail "the package left files"
systemctl is-active --quiet previzd && fail "the service still runs"
[[ -d $take ]] || fail "purge took a take"
step "done"
