#!/usr/bin/env bash
# A technical director gets a take from the set: what is it, what does it need, what will a night of rendering cost, and what do edit
# and comp get?
source "$(dirname "$0")/day.sh"

mkdir takes
cp -r "$demo/session" takes/1A_take001
cp "$demo"/{demo.toml,phantom.glb,virtual.glb,pane.gltf,sprout.glb} .
step 0 "$previzd" devices
step 0 "$previzd" bench --page bench.html
never "Nothing was measured"
[[ -s bench.html ]] || fail "bench left no page"

step 0 "$previz" takes list takes
step 0 "$previz" takes mark takes/1A_take001
step 0 "$previz" takes copy --to backup takes/1A_take001
step 0 "$previz" takes check backup/1A_take001
# A take of which a byte has changed is damaged, and a script knows it by the status.
printf X | dd of=backup/1A_take001/observer.mkv bs=1 seek=400000 conv=notrunc status=none
step 1 "$previz" takes check backup/1A_take001
expect "1A_take001"

step 0 "$previzd" check takes/1A_take001 --set demo.toml
step 0 "$previz" track takes/1A_take001 --set demo.toml
step 0 "$previz" trade takes/1A_take001 --set demo.toml --minutes 1 --scale 0.25 --out trade
never "inf %"
step 0 "$previz" farm takes/1A_take001 --set demo.toml --nodes 3 --dry-run --out night
expect "task"
step 0 "$previz" render takes/1A_take001 --set demo.toml --frames 1 --spp 4 --out night
[[ -s night/0001.exr && -s night/review.mp4 ]] || fail "render left no layers or movie"
# Other settings into the same folder are refused in words, not mixed.
step 1 "$previz" render takes/1A_take001 --set demo.toml --frames 1 --spp 8 --out night
expect "there and"
step 0 "$previz" export takes/1A_take001 handed --set demo.toml
[[ -s handed/camera.usda && -n $(find handed -name '*.chan') ]] || fail "export left no camera"
