#!/usr/bin/env bash
# libcamera's logSetLevel() knows no "*", and no category that has not logged yet.
#
# The environment variable LIBCAMERA_LOG_LEVELS takes "*:ERROR", and applies to every category whenever
# it logs for the first time. One would expect logSetLevel("*", "ERROR"), called before the first
# CameraManager is made, to do the same, and logSetLevel("Camera", "ERROR") for one category. Both
# return without an error and change nothing: the function looks for a category of exactly that name
# among those that have logged before, and does not remember what it was asked for. So the lines at the
# start, which a program wants to keep out of its own output, come all the same; only from the second
# start on "Camera" is quiet.
# Seen with libcamera 0.0.3-6 (Debian 12) on 2026-11-29. What helps: set LIBCAMERA_LOG_LEVELS in the
# program, before there are threads and before anything of libcamera runs.
#
# Needs apt-get of Debian 12 and g++. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
cd "$folder"
apt-get download -qq libcamera-dev=0.0.3-6 libcamera0.0.3=0.0.3-6 liblttng-ust1=2.13.5-1 \
  liblttng-ust-common1=2.13.5-1 libnuma1=2.0.16-1 libdw1=0.188-2.1 libunwind8=1.6.2-3 2>/dev/null
for package in *.deb; do dpkg-deb -x "$package" root; done
libraries=$folder/root/usr/lib/x86_64-linux-gnu
cat >start.cpp <<'CPP'
#include <libcamera/camera_manager.h>
#include <libcamera/logging.h>

#include <cstdio>
#include <cstdlib>

// Starts libcamera after each of these categories was set to ERROR.
int main(int count, char** categories) {
  for (int i = 1; i < count; ++i) {
    if (*categories[i]) libcamera::logSetLevel(categories[i], "ERROR");
    std::fprintf(stderr, "start %d\n", i);
    libcamera::CameraManager manager;
    manager.start();
    manager.stop();
  }
  std::_Exit(0);
}
CPP
g++ -std=c++17 -Iroot/usr/include/libcamera start.cpp -L"$libraries" -Wl,--allow-shlib-undefined -lcamera \
  -lcamera-base -o start
export LD_LIBRARY_PATH=$libraries LIBCAMERA_LOG_NO_COLOR=1
run() { ./start "$@" 2>&1 | grep -E '^start|INFO Camera ' | sed 's/^\[.*INFO/INFO/'; }
echo 'logSetLevel("*"), then logSetLevel("Camera"):'
run '*' Camera | tee said
[[ $(grep -c INFO said) == 1 && $(sed -n 2p said) == INFO* ]] || { echo "changed"; exit 1; }
echo 'LIBCAMERA_LOG_LEVELS=*:ERROR:'
LIBCAMERA_LOG_LEVELS='*:ERROR' run '' | tee said
[[ $(grep -c INFO said) == 0 ]] || { echo "changed"; exit 1; }
