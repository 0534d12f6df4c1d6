#!/usr/bin/env bash
# The Debian packages, as a rig, and the computers with the tools, get them: builds them, asks lintian, and installs,
# upgrades, removes and purges them in a bare Debian 12 that is made for this and thrown away; also signs
# copies, reads their SPDX lists, and builds the last commit twice more to compare. Takes three minutes
# besides the builds, and the network; as root, or as anyone who may make user namespaces.
#   tests/package/run.sh [previzd.deb previz-tools.deb]      packages that are there, instead of a build
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/package
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if [[ $# -gt 0 ]]; then
  cp "$1" "$work/previzd.deb"
  cp "$2" "$work/previz-tools.deb"
else
  cmake --preset release --log-level=WARNING
  cmake --build --preset release --parallel "$(nproc)" --target deb
  cp build/release/previzd_*.deb "$work/previzd.deb"
  cp build/release/previz-tools_*.deb "$work/previz-tools.deb"
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
lintian --fail-on error --info "$work/previzd.deb" "$work/previz-tools.deb"

# The tools start no rig: of the files, only the program, its pages, its completion, examples and lists.
dpkg-deb --raw-extract "$work/previz-tools.deb" "$work/tools"
(cd "$work/tools" && find . -type f -not -path './DEBIAN/md5sums' | sort) >"$work/tool_files"
diff - "$work/tool_files" <<'FILES'
./DEBIAN/control
./usr/bin/previz
./usr/share/bash-completion/completions/previz
./usr/share/doc/previz-tools/changelog.gz
./usr/share/doc/previz-tools/copyright
./usr/share/doc/previz-tools/examples/frames.example.json
./usr/share/doc/previz-tools/examples/parts.example.toml
./usr/share/doc/previz-tools/examples/reference.toml
./usr/share/doc/previz-tools/previz-tools.spdx.json
./usr/share/man/man1/previz-farm.1.gz
./usr/share/man/man1/previz.1.gz
FILES
"$here/hardened.sh" "$work/tools/usr/bin/previz"
# The service carries no importer of models, no map library and no network client but the bus.
if dpkg-deb --field "$work/previzd.deb" Depends | grep -E 'assimp|exiv2|libcairo|yaml-cpp|tinyxml2|libcurl|gdal|opencv-(imgcodecs|photo|contrib)'; then
  echo "tests/package: previzd depends on libraries that only its tools need" >&2
  exit 1
fi
"$here/check_spdx.py" previzd "$work/unpacked"
"$here/check_spdx.py" previz-tools "$work/tools"
"$here/signed.sh" "$work/previzd.deb" "$work/previz-tools.deb"

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
  --customize-hook="copy-in $work/previzd.deb $work/later.deb $work/previz-tools.deb /tmp/package" \
  --customize-hook="copy-in $here/in_bare_debian.sh config/demo /tmp/package" \
  --customize-hook='chroot "$1" bash /tmp/package/in_bare_debian.sh' \
  bookworm - "$sources"
echo "tests/package: passed"
