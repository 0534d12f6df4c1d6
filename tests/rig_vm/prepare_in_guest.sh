# Runs as root in the guest: makes it the rig that the faults meet, with the shipped service at work on
# disks of its own, as /usr/share/doc/previzd/examples/takes-disk.conf has it, and with its shaders
# compiled.
set -uo pipefail
. ./steps.sh
tell_more() {
  journalctl --unit=previzd --no-pager --lines=60 --output=cat
  previzctl status
}

step "disks"
mkdir -p /mnt/a /mnt/b
# A disk that is not there is not waited for as long as systemd would.
for disk in a b; do echo "LABEL=takes_$disk /mnt/$disk ext4 nofail,x-systemd.device-timeout=20s 0 2"; done >>/etc/fstab
systemctl daemon-reload
systemctl start mnt-a.mount mnt-b.mount || fail "the disks are not mounted"

step "camera"
install rig_vm_camera /usr/local/bin/
cp -r light /usr/local/share/
dpkg-deb --fsys-tarfile previzd.deb | tar x -C / ./usr/share/previzd/demo/session
cat >/etc/systemd/system/camera.service <<'UNIT'
[Service]
ExecStart=/usr/local/bin/rig_vm_camera /usr/share/previzd/demo/session 2
[Install]
WantedBy=multi-user.target
UNIT
systemctl enable --now --quiet camera

step "package"
# The emulated processor has the long vectors that lavapipe would use, and is slow at them.
mkdir -p /etc/systemd/system.conf.d /etc/previzd /etc/systemd/system/previzd.service.d
printf '[Manager]\nDefaultEnvironment=LP_NATIVE_VECTOR_WIDTH=128\n' >/etc/systemd/system.conf.d/rig.conf
systemctl daemon-reexec
cp set.toml /etc/previzd/set.toml
dpkg --force-confold --install previzd.deb previz-tools.deb || fail "the package does not install"
cp takes-disk.conf /etc/systemd/system/previzd.service.d/
chown previz:previz /mnt/a /mnt/b
systemctl daemon-reload
systemctl restart previzd || fail "the service does not start again"

step "the first pictures"
within 60 "the bus answers" status_is Set rig
within 900 "pictures are drawn" has_drawn 3
printf 'restarts: %s\n' "$(systemctl show --property=NRestarts --value previzd)"
step "again, with the shaders compiled"
systemctl reset-failed previzd
systemctl restart previzd
within 300 "pictures are drawn" has_drawn 3
[[ $(systemctl show --property=NRestarts --value previzd) == 0 ]] || fail "the watchdog ended it"
previzctl status
previzctl metrics | jq -c '.stages | map_values(.frames)'
top -b -n 1 | head -15
step "done"
