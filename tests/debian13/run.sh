#!/usr/bin/env bash
# previzd in Debian 13, whose compiler, libraries and Mesa are newer than those of Debian 12: installs what
# config/install-deps.sh names, builds, runs the tests, renders a frame of the demo, also by Intel's and
# NVIDIA's drivers without their GPUs, and installs the package, in a Debian that is made for this. As root; half an hour, and the network.
#   tests/debian13/run.sh            all of it
#   tests/debian13/run.sh TARGET...  builds these only, and runs those of them that are tests
# Debian and build are kept in build/debian13.
set -euo pipefail
cd "$(dirname "$0")/../.."
root=build/debian13/root build=build/debian13/build
targets=("$@")
inside() { tests/debian13/inside.sh "$@"; }

inside config/install-deps.sh
inside git config --global --replace-all safe.directory '*'
inside cmake --preset release -B "$build" -DPREVIZ_GATE="${PREVIZ_GATE:-OFF}" --log-level=WARNING
only=()
[[ ${#targets[@]} -eq 0 ]] || only=(--target "${targets[@]}")
inside cmake --build "$build" --parallel "$(nproc)" "${only[@]}"

names=$(IFS='|' && echo "${targets[*]#test_}")
[[ -z $names ]] || names="^($names)$"
inside ctest --test-dir "$build" --parallel "$(($(nproc) + 1))" --output-on-failure --label-exclude long \
  --tests-regex "${names:-.}"
[[ ${#targets[@]} -eq 0 ]] || exit 0

inside "$build/daemon/previz" render config/demo/session --set config/demo/demo.toml --out "$build/demo" \
  --frames 0 --spp 4 --no-video --force

# Intel's and NVIDIA's drivers, on stubs of the kernel's: nothing is computed, but memory, compilers and
# submissions are theirs.
stubs=build/gpu_drivers
[[ -e $stubs/opt/stubs/mesa_version ]] || tests/gpu_code/drivers.sh "$stubs"
icd=/usr/share/vulkan/icd.d
# on_stub NAME VARIABLE=VALUE...
on_stub() {
  local log=$build/$1.log
  inside env "${@:2}" timeout 300 "$build/daemon/previz" render config/demo/session --set config/demo/demo.toml \
    --out "$build/$1" --frames 0 --spp 2 --scale 0.25 --neighbours 0 --no-video --force --validation >"$log" 2>&1 || {
    echo "debian13: the demo does not run on $1:" >&2
    cat "$log" >&2
    exit 1
  }
  ! grep "vulkan validation" "$log" || exit 1
  echo "debian13: the demo runs on $1"
}
on_stub intel INTEL_STUB_GPU_DEVICE_ID=0x56a0 "VK_DRIVER_FILES=$icd/intel_icd.json" \
  "LD_PRELOAD=$PWD/$stubs/opt/stubs/libintel_noop_drm_shim.so"
on_stub nvk NOUVEAU_CHIPSET=193 NVK_I_WANT_A_BROKEN_VULKAN_DRIVER=1 "VK_DRIVER_FILES=$icd/nouveau_icd.json" \
  "LD_PRELOAD=$PWD/$stubs/opt/stubs/libnouveau_noop_drm_shim.so"

# Rays by the units of a card, which Mesa has on the CPU.
inside env PREVIZ_HARDWARE_RAYS=1 MESA_SHADER_CACHE_DIR=build/debian13/shader_cache \
  "$build/tests/unit/render/test_render" --gtest_brief=1 \
  --gtest_filter='Alpha.*:Pane.*:Deform*:DirectLight.*:Caustic*:Composite.*:Mirror*:ColouredGlass.*'
inside cmake --build "$build" --target deb
# shellcheck disable=SC2016
inside bash -ec 'apt-get install --yes --quiet --no-install-recommends "$1"/{previzd,previz-tools}_*.deb >/dev/null
  previzd check config/demo/demo.toml
  previz takes list config/demo
  apt-get purge --yes --quiet previzd previz-tools >/dev/null' - "$PWD/$build"
echo "debian13: passed, in Debian $(<"$root/etc/debian_version")"
