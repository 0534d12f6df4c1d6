#!/usr/bin/env bash
# Installs what building, testing and running previzd needs on Debian 12 and 13, and only what is missing;
# and further packages that are named. As root, or through sudo; asks no questions.
set -euo pipefail

packages=(
  # tools
  cmake ninja-build g++ ccache pkg-config git glslang-tools spirv-tools clang-format clang-tidy
  # Vulkan: loader, Mesa's drivers (with a CPU one) and the validation layer the tests switch on
  libvulkan-dev mesa-vulkan-drivers vulkan-validationlayers
  # pictures and video
  libopencv-dev libopenexr-dev libimath-dev libpng-dev libspng-dev libtiff-dev libwebp-dev libexiv2-dev liblcms2-dev
  libcairo2-dev
  libavformat-dev libavcodec-dev libavutil-dev libswscale-dev libdeflate-dev libjpeg62-turbo-dev
  # the display and its text
  libegl-dev libgles-dev libegl-mesa0 libgl1-mesa-dri libgbm-dev libdrm-dev libfreetype-dev libharfbuzz-dev
  fonts-dejavu-core
  # cameras, buttons
  libaravis-dev libcamera-dev libudev-dev libusb-1.0-0-dev libgpiod-dev libhidapi-dev
  # markers, geometry, scenes
  libapriltag-dev libembree-dev libtinygltf-dev libdraco-dev libmeshoptimizer-dev libassimp-dev libglm-dev
  # files, command line, log, hashes
  libtomlplusplus-dev nlohmann-json3-dev libyaml-cpp-dev libtinyxml2-dev libcli11-dev libspdlog-dev libfmt-dev libssl-dev
  # main loop, service, D-Bus
  libsystemd-dev dbus
  # tests
  libgtest-dev libgmock-dev libusbredirparser-dev groff-base poppler-utils
  # package, and its test in a bare system
  dpkg-dev python3 file lintian mmdebstrap systemd debsigs debsig-verify
)

missing=()
for package in "${packages[@]}" "$@"; do
  state=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $state == installed ]] || missing+=("$package")
done
if [[ ${#missing[@]} -eq 0 ]]; then
  echo "install-deps: everything is installed"
  exit 0
fi

as_root=()
if [[ $EUID -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "install-deps: run this as root, or install sudo; missing: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "install-deps: installing ${missing[*]}"
"${as_root[@]}" apt-get update --quiet
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install --quiet --yes --no-install-recommends "${missing[@]}"
