# Runs as root in the guest, in the folder that run.sh has filled.
set -uo pipefail
. ./steps.sh

# Runs tests of a suite: SUITE FILTER [COMMAND...], as COMMAND does. Here every device is there: none
# may be skipped.
suite() {
  local log=$1.log
  "${@:3}" "./test_$1" --gtest_filter="$2" >"$log" 2>&1 || { tail -60 "$log"; fail "$1 $2"; }
  grep -q '\[  SKIPPED \]' "$log" && { cat "$log"; fail "$1 $2: skipped"; }
  grep -q '\[  PASSED  \] [1-9]' "$log" || fail "$1 $2: no test ran"
  sed -n 's/^\[       OK \] /   /p' "$log"
}

step "devices"
groupadd --system previz # which the package makes
cp 70-previzd.rules /etc/udev/rules.d/
udevadm control --reload
rig-devices vivid
rig-devices gpio
modprobe uhid
mkdir pad
chown nobody pad # who presses it later
touch usb_camera pad/cable
usb_camera=usb-previz_Rig_camera_RIGUSB1-video-index0
vivid=platform-vivid.0-video-index0
is_found() { ./previzd devices 2>/dev/null >found.txt; grep -q "$1" found.txt; }
within 60 "the USB camera is found by V4L2" is_found "$usb_camera"
within 60 "the USB camera is found by libcamera" is_found 1209:0002
within 60 "the USB pad is found" is_found 1209:0003
within 60 "the contacts are found" is_found gpio:rig-buttons:button4
cat found.txt
export PREVIZ_TEST_USB_CABLE=$PWD/usb_camera
# What malloc keeps for the thread that freed it would count as in use.
export GLIBC_TUNABLES=glibc.malloc.tcache_count=0

for camera in "$vivid" "$usb_camera"; do
  step "V4L2: $camera"
  export PREVIZ_TEST_V4L2=$camera
  suite camera_compliance 'Drivers/*/v4l2'
  suite replug 'Drivers/*/v4l2'
done

step "libcamera"
suite camera_compliance 'Drivers/*/libcamera'
suite replug 'Drivers/*/libcamera'

step "a USB camera that is wedged"
suite usb '*'

step "contacts and pads"
for button in 1 2 3 4; do rig-devices press $button; done # low, for the tests' wiring
suite buttons 'ButtonDevices.*-*Usb*'

step "a pad on the USB that hidraw may not open, for one who may no more than the service"
cat >/etc/udev/rules.d/71-rig.rules <<'END'
SUBSYSTEM=="hidraw", ATTRS{idVendor}=="1209", ATTRS{idProduct}=="0003", GROUP="root", MODE="0600"
SUBSYSTEM=="usb", ENV{DEVTYPE}=="usb_device", ATTR{idVendor}=="1209", ATTR{idProduct}=="0003", GROUP="previz", MODE="0660"
END
udevadm control --reload
udevadm trigger --settle --subsystem-match=hidraw --subsystem-match=usb
export PREVIZ_TEST_USB_PAD=$PWD/pad/cable
suite buttons '*Usb*' setpriv --reuid=nobody --regid=nogroup --groups=previz

step "the screen"
export PREVIZ_TEST_SCREEN=Virtual-1
suite display_devices '*'
step "done"
