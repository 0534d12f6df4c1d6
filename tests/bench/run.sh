#!/bin/sh
# All benchmarks of a build: run.sh BUILD_DIR OUT_DIR [SETDIR...]. Writes rays.md, instances.md,
# move.md, deform.md, guides.md, hard.md, and where ground truth sets are given equal_error.md and tracking.md.
# Beside Cycles: cycles/run. In memory and in scratch files: memory/run. A live frame by its size, samples, triangles and passes: `previzd bench`.
set -eu
if [ $# -lt 2 ]; then
  echo "usage: $0 BUILD_DIR OUT_DIR [SETDIR...]" >&2
  exit 2
fi
bench="$1/tests/bench"
out="$2"
shift 2
mkdir -p "$out"

"$bench/bench_rays" | tee "$out/rays.md"
"$bench/bench_rays" --instanced --triangles 98000 1000000 | tee "$out/instances.md"
"$bench/bench_move" | tee "$out/move.md"
"$bench/bench_deform" | tee "$out/deform.md"
demo="$(dirname "$0")/../../config/demo"
"$bench/bench_guides" "$demo/session" "$demo/demo.toml" | tee "$out/guides.md"
"$bench/bench_hard" | tee "$out/hard.md"
[ $# -eq 0 ] || "$bench/bench_equal_error" "$@" | tee "$out/equal_error.md"
[ $# -eq 0 ] || "$bench/bench_tracking" "$@" | tee "$out/tracking.md"
