#!/usr/bin/env bash
# The Debian package, as a rig gets it: builds it, asks lintian, and installs, upgrades, removes and
# purges it in a bare Debian 12 that is made for this and thrown away. Takes three minutes and the
# network; as root, or as anyone who may make user namespaces.
#   tests/package/run.sh [previzd.deb]      a package that is there already, instead of building one
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/package
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if [[ $# -gt 0 ]]; then
  cp "$1" "$work/previzd.deb"
else
  cmake --preset release --log-level=WARNING
  cmake --build --preset release --parallel "$(nproc)" --target deb
  cp build/release/previzd_*.deb "$work/previzd.deb"
fi

version=$(dpkg-deb --field "$work/previzd.deb" Version)
logged=$(dpkg-parsechangelog -l systemd/package/debian/changelog -S Version)
if [[ $version != "$logged" ]]; then
  echo "tests/package: the package is $version, systemd/package/debian/changelog says $logged" >&2
  exit 1
fi
dpkg-deb --raw-extract "$work/previzd.deb" "$work/unpacked"
"$here/hardened.sh" "$work"/unpacked/usr/{bin/previz{d,ctl},libexec/previzd/previzd-aravis}
lintian --fail-on error --info "$work/previzd.deb"

# The same package with a later version and another default set: what an upgrade brings.
dpkg-deb --raw-extract "$work/previzd.deb" "$work/later"
sed -i "s/^Version: .*/Version: $version+later/" "$work/later/DEBIAN/control"
echo '# a later default' >>"$work/later/etc/previzd/set.toml"
dpkg-deb --root-owner-group --build "$work/later" "$work/later.deb" >/dev/null

# From the archive that this machine itself is from.
sources=$work/debian.sources
cat /etc/apt/sources.list.d/*.sources >"$sources"
mmdebstrap --quiet --variant=minbase --format=null --aptopt='APT::Install-Recommends "false"' \
  --customize-hook='mkdir "$1/tmp/package"' \
  --customize-hook="copy-in $work/previzd.deb $work/later.deb $here/in_bare_debian.sh /tmp/package" \
  --customize-hook='chroot "$1" bash /tmp/package/in_bare_debian.sh' \
  bookworm - "$sources"
echo "tests/package: passed"
