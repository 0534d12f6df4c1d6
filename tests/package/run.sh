#!/usr/bin/env bash
# The Debian packages, as a rig and a farm's computer get them: builds them, asks lintian, and installs,
# upgrades, removes and purges them in a bare Debian 12 that is made for this and thrown away; also signs
# copies, reads their SPDX lists, and builds the last commit twice more to compare. Takes three minutes
# besides the builds, and the network; as root, or as anyone who may make user namespaces.
#   tests/package/run.sh [previzd.deb previzd-farm.deb]      packages that are there, instead of a build
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/package
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if [[ $# -gt 0 ]]; then
  cp "$1" "$work/previzd.deb"
  cp "$2" "$work/previzd-farm.deb"
else
  cmake --preset release --log-level=WARNING
  cmake --build --preset release --parallel "$(nproc)" --target deb
  cp build/release/previzd_*.deb "$work/previzd.deb"
  cp build/release/previzd-farm_*.deb "$work/previzd-farm.deb"
  "$here/reproducible.sh"
fi

version=$(dpkg-deb --field "$work/previzd.deb" Version)
logged=$(dpkg-parsechangelog -l systemd/package/debian/changelog -S Version)
if [[ $version != "$logged" ]]; then
  echo "tests/package: the package is $version, systemd/package/debian/changelog says $logged" >&2
  exit 1
fi
dpkg-deb --raw-extract "$work/previzd.deb" "$work/unpacked"
"$here/hardened.sh" "$work"/unpacked/usr/{bin/previz{d,ctl},libexec/previzd/previzd-aravis}
lintian --fail-on error --info "$work/previzd.deb" "$work/previzd-farm.deb"

# A farm's computer starts no rig: of the files, only the program, its pages, its completion and its lists.
dpkg-deb --raw-extract "$work/previzd-farm.deb" "$work/farm"
(cd "$work/farm" && find . -type f -not -path './DEBIAN/md5sums' | sort) >"$work/farm_files"
diff - "$work/farm_files" <<'FILES'
./DEBIAN/control
./usr/bin/previzd
./usr/share/bash-completion/completions/previzd
./usr/share/doc/previzd-farm/changelog.gz
./usr/share/doc/previzd-farm/copyright
./usr/share/doc/previzd-farm/previzd-farm.spdx.json
./usr/share/man/man1/previzd-farm.1.gz
./usr/share/man/man5/previz-set.5.gz
./usr/share/man/man8/previzd.8.gz
FILES
cmp "$work/farm/usr/bin/previzd" "$work/unpacked/usr/bin/previzd"
"$here/check_spdx.py" previzd "$work/unpacked"
"$here/check_spdx.py" previzd-farm "$work/farm"
"$here/signed.sh" "$work/previzd.deb" "$work/previzd-farm.deb"

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
  --customize-hook="copy-in $work/previzd.deb $work/later.deb $work/previzd-farm.deb /tmp/package" \
  --customize-hook="copy-in $here/in_bare_debian.sh config/demo /tmp/package" \
  --customize-hook='chroot "$1" bash /tmp/package/in_bare_debian.sh' \
  bookworm - "$sources"
echo "tests/package: passed"
