#!/usr/bin/env bash
# Shows what GPUs make of the shaders. It compiles every pass, as a driver gets it for the demo set and
# with all features, by the compilers of five GPUs, and compares with kept.tsv. Nothing is run, and no GPU is
# needed. It fails where a pass has become worse by more than a tenth: more registers, spills, scratch or
# instructions, or fewer lanes at once. As root; a minute, the first time seven (drivers.sh).
#   tests/gpu_code/run.sh            compares, and prints what is different
#   tests/gpu_code/run.sh --keep     keeps what is so now as kept.tsv, and prints the demo's table
# The columns of kept.tsv are those of compile_modules.cpp without the seconds.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/gpu_code
gpus=(radv:navi31 radv:navi21 radv:gfx1201 anv:0x56a0 nvk:193)  # RX 7900, RX 6800, RX 9070, Arc A770, RTX 4080
drivers=${PREVIZ_GPU_DRIVERS:-build/gpu_drivers}

if [[ $# -gt 1 || ${1:---keep} != --keep ]]; then
  echo "gpu_code: there is only --keep, not: $*" >&2
  exit 2
fi
if [[ $EUID -ne 0 ]]; then
  echo "gpu_code: run it as root, which it needs for mounts and chroot" >&2
  exit 1
fi
for tool in mmdebstrap unshare; do
  command -v "$tool" >/dev/null && continue
  echo "gpu_code: $tool is missing; apt-get install mmdebstrap util-linux" >&2
  exit 1
done
[[ -e build/release/CMakeCache.txt ]] || cmake --preset release --log-level=WARNING
cmake --build --preset release --parallel "$(nproc)" --target gpu_code_modules gpu_code_compile
[[ -e $drivers/opt/stubs/mesa_version ]] || "$here/drivers.sh" "$drivers"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
programs=build/release/tests/gpu_code
"$programs/gpu_code_modules" config/demo/demo.toml "$work/modules"
cp "$programs/gpu_code_compile" "$work/"
{
  echo "# $(<"$drivers/opt/stubs/mesa_version")"
  for gpu in "${gpus[@]}"; do
    if ! "$here/drivers.sh" "$drivers" "$gpu" "$work" ./gpu_code_compile "$gpu" modules 2>"$work/log"; then
      echo "gpu_code: $gpu does not compile the shaders:" >&2
      cat "$work/log" >&2
      exit 1
    fi
  done
} | cut -f 1-8 >"$work/now.tsv"

if [[ ${1:-} == --keep ]]; then
  cp "$work/now.tsv" "$here/kept.tsv"
  awk -f "$here/table.awk" "$here/kept.tsv"
else
  awk -f "$here/compare.awk" "$here/kept.tsv" "$work/now.tsv"
fi
