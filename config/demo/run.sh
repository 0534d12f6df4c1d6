#!/usr/bin/env bash
# The main job on the bundled take: installs what is missing, builds, and renders the path-traced
# composite of every frame to out/demo. Needs no GPU. Options of `previz render` may be given:
#   config/demo/run.sh --spp 256 --frames 0
# Run again, it continues where it was stopped; after changing options or the set, add --force.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=out/demo

config/install-deps.sh
cmake --preset release --log-level=WARNING
cmake --build --preset release --parallel "$(nproc)" --target previzd previz previzctl manual
build/release/daemon/previz render config/demo/session --set config/demo/demo.toml \
  --out "$out" "$@"

echo
echo "The pictures, as a display would show them:  $PWD/$out/0000.png ..."
echo "All layers, linear 32-bit float (OpenEXR):   $PWD/$out/0000.exr ..."
echo "The review video:                            $PWD/$out/review.mp4"
echo
echo "The manual:                                  man -l $PWD/build/release/systemd/package/manual/man/previzd.8"
echo "                                             (beside it previzctl.1, previz-set.5, previz.1, previz-farm.1)"
echo "A rig (previzd run --bus) is operated by:    $PWD/build/release/daemon/control/previzctl"
