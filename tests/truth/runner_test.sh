#!/bin/sh
# The truth runner on the bundled set, from fisheye frames and tags to figures, at one sample:
#   runner_test.sh RUNNER SETDIR
set -eu
runner=$1
set_dir=$2
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

fail() {
  echo "runner_test: $1" >&2
  exit 1
}

"$runner" "$set_dir" --light captured --pose tracked --spp 1 --frames 12 --out "$out" ||
  fail "a run that only measures must exit 0"
for file in 0012.exr 0012.png 0012_compare.png metrics.json; do
  [ -s "$out/glass/$file" ] || fail "$file was not left behind"
done
for key in '"frames"' '"0012"' '"e_diff"' '"e_virtual"' '"e_mask"' '"psnr"' '"ssim"' '"noise_diff"' \
           '"seconds"' '"samples": 1'; do
  grep -q "$key" "$out/glass/metrics.json" || fail "metrics.json has no $key"
done
grep -q '"untouched"' "$out/glass/metrics.json" && fail "the frame was not rendered"

"$runner" "$set_dir" --live --frames 2 --out "$out" 2>"$out/message" && fail "frame 2 has no truth"
"$runner" "$set_dir" --live --frames 0 --no-history --out "$out" || fail "a sequence must play"
for key in '"flicker"' '"history": false' '"samples": 1' '"bias_diff"'; do
  grep -q "$key" "$out/glass/metrics.json" || fail "metrics.json of a sequence has no $key"
done

status=0
"$runner" "$set_dir" --spp 1 --frames 12 --bounds full --out "$out" || status=$?
[ "$status" = 1 ] || fail "one sample cannot hold the bounds, but the exit status was $status"

status=0
"$runner" "$out" --out "$out" 2>"$out/message" || status=$?
[ "$status" = 2 ] || fail "a directory that is no set must exit 2, not $status"
grep -q 'set.json' "$out/message" || fail "the message does not name set.json"
