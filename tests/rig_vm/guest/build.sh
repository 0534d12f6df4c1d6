#!/usr/bin/env bash
# Builds the guest: Debian 12 with its stock kernel, gpio-sim, and everything the packages depend on,
# but not the packages. 
#   build.sh DIRECTORY PREVIZD.deb PREVIZ-TOOLS.deb   leaves vmlinuz, initrd.gz, root.ext4 there.
# As root; takes a few minutes and the network.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1"
to=$(realpath "$1")
mapfile -t debs < <(realpath "${@:2}")
root=$to/root
[[ -e $to/modules/kver ]] || "$here/build_modules.sh" "$to/modules"
kver=$(cat "$to/modules/kver")

packages=(systemd systemd-sysv udev dbus polkitd kmod iproute2 procps dmsetup "linux-image-$kver" jq)
# Kernel modules that no rig needs, documentation, and the generic initrd, which is slow.
leave_out=('/usr/share/doc/*' '/usr/share/locale/*' '/usr/share/man/*' '/usr/share/info/*'
  /etc/kernel/postinst.d/initramfs-tools)
for modules in arch/x86/kvm drivers/{net,infiniband,scsi,ata,iio,hwmon,mtd,isdn,nvme,target} \
  drivers/{bluetooth,crypto,edac,mfd,power} drivers/gpu/drm/{amd,i915,nouveau,radeon} \
  drivers/media/{pci,dvb-frontends,tuners} drivers/staging \
  net/{netfilter,sched,bluetooth,mac80211,wireless,ceph,sctp,tipc,rds} \
  fs/{ocfs2,xfs,btrfs,ceph,gfs2,nfs,nfsd,smb,f2fs,cifs,jfs,reiserfs,ubifs,afs,dlm}; do
  leave_out+=("/lib/modules/*/kernel/$modules/*")
done

rm -rf "$root"
sources=$to/debian.sources
cat /etc/apt/sources.list.d/*.sources >"$sources"
# The packages go in and out again, which leaves what they depend on.
mmdebstrap --quiet --variant=minbase --mode=root --format=directory \
  --aptopt='APT::Install-Recommends "false"' "${leave_out[@]/#/--dpkgopt=path-exclude=}" \
  --include="$(IFS=,; echo "${packages[*]}")" \
  --customize-hook="copy-in ${debs[*]} /tmp" \
  --customize-hook="chroot \"\$1\" env DEBIAN_FRONTEND=noninteractive sh -c 'cd /tmp && apt-get -qq install ./*.deb' >/dev/null" \
  --customize-hook='chroot "$1" dpkg --purge previzd previz-tools' \
  bookworm "$root" "$sources"

install -D -m 644 -t "$root/lib/modules/$kver/extra" "$to"/modules/*.ko
chroot "$root" depmod "$kver"
install -m 755 "$here/rig-run" "$here/rig-devices" "$root/usr/local/sbin/"
install -m 644 "$here/rig-run.service" "$root/etc/systemd/system/"
systemctl --root="$root" --quiet enable rig-run.service
# What only costs time at boot: every process is expensive on an emulated processor.
systemctl --root="$root" --quiet mask apt-daily.timer apt-daily-upgrade.timer e2scrub_all.timer \
  e2scrub_reap.service fstrim.timer dpkg-db-backup.timer getty.target systemd-timesyncd.service \
  systemd-networkd.service systemd-networkd.socket systemd-firstboot.service \
  systemd-random-seed.service systemd-pstore.service systemd-update-utmp.service \
  systemd-remount-fs.service systemd-journal-flush.service
echo rig >"$root/etc/hostname"
mkdir -p "$root/etc/systemd/journald.conf.d" "$root/rig"
printf '[Journal]\nStorage=volatile\n' >"$root/etc/systemd/journald.conf.d/rig.conf"

# An initrd that mounts the disk: as it is for the kernel's parameter rig.keep, and else read only,
# below memory that takes what is written.
initrd=$to/initrd
rm -rf "$initrd"
mkdir -p "$initrd"/{bin,dev,lib,proc,disk,ram,new}
cp /bin/busybox "$initrd/bin/"
for module in virtio_pci virtio_blk crc32c_generic ext4 overlay; do
  chroot "$root" modprobe -S "$kver" --show-depends "$module"
done | awk '/^insmod/ && !seen[$2]++ {print $2}' | while read -r module; do
  cp "$root$module" "$initrd/lib/"
  echo "/bin/busybox insmod /lib/$(basename "$module")" >>"$initrd/load"
done
cp "$here/init" "$initrd/init"
chmod 755 "$initrd/init"
(cd "$initrd" && find . | cpio -o -H newc --quiet | gzip -1) >"$to/initrd.gz"
cp "$root/boot/vmlinuz-$kver" "$to/vmlinuz"

size_kib=$(du -skx "$root" | cut -f1)
mke2fs -q -F -t ext4 -m 0 -d "$root" "$to/root.ext4" $((size_kib * 12 / 10 + 524288))k
rm -rf "$root" "$initrd"
