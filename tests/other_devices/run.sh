#!/usr/bin/env bash
# Runs the renderer's tests on Vulkan devices that are not there: Mesa's CPU driver with subgroups of 4
# and of 16 lanes (the gate's computers have 8); the same driver with the name, limits and memory of
# graphics cards (other_card.cpp), below the validation layer, which then holds the renderer to them; and
# another CPU driver, SwiftShader, out of Debian's package chromium-common, which is unpacked and not installed,
# with each buffer between memory that no shader may touch (guard_pages.cpp).
# Without root; the first time it needs the network.
#   tests/other_devices/run.sh              all of them
#   tests/other_devices/run.sh DEVICE...    lanes4, lanes16, a card of cards/*.txt, swiftshader
# A case that is skipped is shown with its reason. PREVIZ_BUILD names a build to use in place of build/release.
# The logs are kept in build/other_devices.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/other_devices
out=$PWD/build/other_devices
build=${PREVIZ_BUILD:-build/release}
lavapipe=$(echo /usr/share/vulkan/icd.d/lvp_icd*.json)
at_once=$(nproc)
failures=0

# What differs by the device: memory, copies, limits, groups of lanes, and a picture of each kind. Not how many
# submissions a frame is: they are made to take no long time, and a processor is slow for a card.
card_cases='Buffers.*:MappedMemory.*:AsGpu.*:Kernel.*:DeviceLimits.*:DevicePlate.*'
card_cases+=':Memory/DevicePlates.*:CardPictures.*:PlatePool.*:PassClock.*:PipelineCacheTest.*:Composite.*'
card_cases+=':Show.*:History.OfAStill*:DeformingHistory.*:Deforming.*:DenoiseSparse.*:PhotonSort.*:Photons.*'
card_cases+=':ManyLamps.*:Alpha.*:LayerTextures.*:CameraRadiance.*:Pane.*'

# The filter by which CTest leaves the long cases of a program out.
gate_cases() {
  ctest --test-dir "$build" --label-exclude long --tests-regex "^$1(_1of[0-9]+)?\$" --show-only=json-v1 |
    grep -o 'GTEST_FILTER=[^"]*' | head -n 1 | cut -d= -f2-
}

# Runs cases of a program, as many parts of them at once as there are cores, and prints what became of them.
# run_cases DEVICE PROGRAM FILTER [VARIABLE=VALUE]...
run_cases() {
  local device=$1 program=$2 filter=$3 begin=$SECONDS part status=0
  local logs=$out/logs/$device.${program##*/}
  rm -f "$logs".*
  mkdir -p "$out/logs" "$out/shaders"
  local parts=()
  for ((part = 0; part < at_once; ++part)); do
    env LP_NUM_THREADS=1 MESA_SHADER_CACHE_DIR="$out/shaders/$device" GTEST_TOTAL_SHARDS="$at_once" \
      GTEST_SHARD_INDEX="$part" GTEST_FILTER="$filter" "${@:4}" \
      timeout 1800 "$build/tests/$program" >"$logs.$part" 2>&1 &
    parts+=($!)
  done
  wait "${parts[@]}" || true  # the logs say what failed
  awk -v seconds=$((SECONDS - begin)) -v run="$device ${program##*/}" \
    -f "$here/outcome.awk" "$logs".* || status=$?
  [[ $status == 0 ]] || failures=$((failures + 1))
}

unpack_swiftshader() {
  [[ -e $out/swiftshader/vk_swiftshader_icd.json ]] && return
  rm -rf "$out/chromium"
  mkdir -p "$out/chromium" "$out/swiftshader"
  (cd "$out/chromium" && apt-get download -qq chromium-common && dpkg-deb -x chromium-common_*.deb .)
  cp "$out"/chromium/usr/lib/chromium/{libvk_swiftshader.so,vk_swiftshader_icd.json} "$out/swiftshader/"
  rm -rf "$out/chromium"
}

# build_layer NAME
build_layer() {
  mkdir -p "$out/layer"
  c++ -std=c++20 -O1 -Wall -Wextra -Werror -shared -fPIC "$here/$1.cpp" -o "$out/layer/lib$1.so"
  cp "$here/$1.json" "$out/layer/"
}

# The display's driver is Mesa's, too, and cannot draw with 16 lanes.
on_lanes() {
  local cases settings=("VK_DRIVER_FILES=$lavapipe" "LP_NATIVE_VECTOR_WIDTH=$(($1 * 32))")
  cases=$(gate_cases render)
  [[ $1 != 16 ]] || cases+=':CardPictures.*'
  run_cases "lanes$1" unit/scene/test_bvh "$(gate_cases bvh)" "${settings[@]}"
  run_cases "lanes$1" unit/render/test_render "$cases" "${settings[@]}"
  run_cases "lanes$1" extremes/test_extremes "$(gate_cases extremes)" "${settings[@]}"
}

# The loader of Debian 12 orders layers by VK_LAYER_PATH, not by VK_INSTANCE_LAYERS: the first is the
# one that the program meets first.
on_card() {
  build_layer other_card
  run_cases "$1" unit/render/test_render "$card_cases" "VK_DRIVER_FILES=$lavapipe" "OTHER_CARD=$here/cards/$1.txt" \
    "MESA_SHADER_CACHE_DIR=$out/shaders/lanes8" \
    "VK_LAYER_PATH=/usr/share/vulkan/explicit_layer.d:$out/layer" \
    VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation:VK_LAYER_PREVIZ_other_card
}

# It does not check where shaders read and write, so that one which does so past a buffer ends the program here, and
# guard_pages says in which pass; Mesa's CPU driver checks, and hides it. The display's pictures stay on another
# device, so that none can be shared; and it is too slow for the frames of LiveBudget.
on_swiftshader() {
  unpack_swiftshader
  build_layer guard_pages
  local settings=("VK_DRIVER_FILES=$out/swiftshader/vk_swiftshader_icd.json"
    "VK_LAYER_PATH=/usr/share/vulkan/explicit_layer.d:$out/layer"
    VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation:VK_LAYER_PREVIZ_guard_pages)
  run_cases swiftshader unit/scene/test_bvh "$(gate_cases bvh)" "${settings[@]}"
  run_cases swiftshader unit/render/test_render "$(gate_cases render):CardPictures.*:LiveBudget*" "${settings[@]}"
  run_cases swiftshader extremes/test_extremes "$(gate_cases extremes)" "${settings[@]}"
}

devices=("$@")
if [[ $# -eq 0 ]]; then
  mapfile -t cards < <(basename --suffix .txt $here/cards/*.txt)
  devices=(lanes4 lanes16 "${cards[@]}" swiftshader)
fi
if [[ -z ${PREVIZ_BUILD:-} ]]; then
  [[ -e $build/CMakeCache.txt ]] || cmake --preset release --log-level=WARNING
  cmake --build "$build" --parallel "$at_once" --target test_bvh test_render test_extremes
fi
for device in "${devices[@]}"; do
  case $device in
    lanes4 | lanes16) on_lanes "${device#lanes}" ;;
    swiftshader) on_swiftshader ;;
    *)
      if [[ ! -e $here/cards/$device.txt ]]; then
        echo "other_devices: unknown device \"$device\"; allowed: lanes4, lanes16, swiftshader and what is in" \
          "$here/cards" >&2
        exit 2
      fi
      on_card "$device"
      ;;
  esac
done
[[ $failures == 0 ]] || { echo "other_devices: $failures runs failed; their logs are in $out/logs" >&2; exit 1; }
