#!/usr/bin/env bash
# Builds the packages of the last commit twice, in folders of other names, at other times, with another
# umask, time zone, language and number of processes, and compares them byte by byte. What differs is
# named. Each folder has a name space of its own in ccache, so that nothing that was compiled for the one
# is taken for the other.
#   tests/package/reproducible.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
source=$PWD
to=$source/build/reproducible

# build FOLDER UMASK TZ LANGUAGE PROCESSES
build() (
  umask "$2"
  export TZ=$3 LC_ALL=$4 CCACHE_NAMESPACE=$1 CCACHE_DEPEND=1
  rm -rf "${to:?}/$1"
  git clone --quiet "$source" "$to/$1"
  cd "$to/$1"
  cmake --preset release --log-level=WARNING -DPREVIZ_TESTS=OFF
  cmake --build --preset release --parallel "$5" --target deb
)
mkdir -p "$to"
build first 022 UTC C.UTF-8 "$(nproc)"
build second-and-longer 077 Asia/Kathmandu C 1

# unpack PACKAGE FOLDER: its members, and the files in them.
unpack() {
  mkdir -p "$2/data" "$2/control"
  ar x --output "$2" "$1"
  tar -xaf "$2"/data.tar.* -C "$2/data"
  tar -xaf "$2"/control.tar.* -C "$2/control"
  tar -tvaf "$2"/data.tar.* --full-time >"$2/data.list"
}
status=0
for first in "$to"/first/build/release/*.deb; do
  name=$(basename "$first")
  second=$to/second-and-longer/build/release/$name
  cmp "$first" "$second" && continue
  status=1
  rm -rf "${to:?}/members"
  unpack "$first" "$to/members/first"
  unpack "$second" "$to/members/second"
  echo "reproducible: two builds of $name differ in:" >&2
  diff --recursive --brief "$to/members/first" "$to/members/second" >&2 || true
done
[[ $status != 0 ]] || echo "reproducible: two builds gave the same bytes"
exit "$status"
