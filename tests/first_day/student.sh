#!/usr/bin/env bash
# A student has a clip with printed tags, photos of a chessboard, and an HDRI of unknown brightness and direction.
source "$(dirname "$0")/day.sh"

# Photos of the printed board as the demo's camera would take them: ffmpeg's `perspective` puts the board's corners where that
# camera has them. photo NAME TURN_X TURN_Y TURN_Z (degrees) X Y Z (the middle of the page before the camera, metres)
photo() {
  local corners
  corners=$(awk -v a="$2" -v b="$3" -v c="$4" -v x="$5" -v y="$6" -v z="$7" 'BEGIN {
    pi = atan2(0, -1); a *= pi / 180; b *= pi / 180; c *= pi / 180
    for (v = -1; v <= 1; v += 2) for (u = -1; u <= 1; u += 2) {
      p = u * 0.297 / 2; q = v * 0.21 / 2                                 # on the page, turned about Z, Y and X
      p1 = cos(c) * p - sin(c) * q; q1 = sin(c) * p + cos(c) * q
      p2 = cos(b) * p1; r2 = -sin(b) * p1
      q3 = cos(a) * q1 - sin(a) * r2; r3 = sin(a) * q1 + cos(a) * r2
      k = 4 * 640 / (r3 + z)                                        # pixels of four a pixel
      printf ":x%d=%.3f:y%d=%.3f", i, k * (p2 + x) + 4 * 316.7, i, k * (q3 + y) + 4 * 244.3; ++i
    } }')
  ffmpeg -v error -y -i board.png -vf "scale=2560:1920,perspective=${corners#:}:sense=destination:interpolation=linear,scale=640:480:flags=area" "$1"
}
# An HDRI of the demo's room, roughly: its two lamps and its dark walls, at a fifth of their brightness and turned by 70 degrees.
# Radiance pictures have 4 bytes a pixel: three mantissas and their exponent.
environment() {
  printf '#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 128\n'
  LC_ALL=C awk 'BEGIN {
    pi = atan2(0, -1)
    for (row = 0; row < 64; ++row) for (column = 0; column < 128; ++column) {
      up = pi * (0.5 - (row + 0.5) / 64); round = 2 * pi * (0.5 - (column + 0.5) / 128) - 70 / 180 * pi
      x = cos(up) * cos(round); y = cos(up) * sin(round); z = sin(up)
      if (-0.41 * x + 0.45 * y + 0.79 * z > 0.995) printf "%c%c%c%c", 200, 176, 145, 132
      else if (0.71 * x + 0.33 * y + 0.62 * z > 0.995) printf "%c%c%c%c", 130, 144, 176, 131
      else printf "%c%c%c%c", 200, 200, 200, (z > 0 ? 122 : 124)
    } }'
}

mkdir photos clip
step 0 "$previz" print tags --ids 0-2 --size 80mm
step 0 "$previz" print board chessboard:9x6:25mm
pdftoppm -r 200 -png -singlefile board.pdf board
photo photos/1.png 0 0 0 0 0 0.45
photo photos/2.png 30 0 0 0.02 0 0.42
photo photos/3.png -30 0 5 -0.02 0.02 0.42
photo photos/4.png 0 30 0 0.04 0 0.42
photo photos/5.png 0 -30 -5 -0.04 0 0.42
photo photos/6.png 20 20 10 0.08 0.05 0.5
photo photos/7.png -20 20 -10 -0.08 0.05 0.5
photo photos/8.png 20 -20 90 0.08 -0.05 0.5
photo photos/9.png -20 -20 80 -0.08 -0.05 0.5
photo photos/10.png 35 10 40 0 0 0.45
photo photos/11.png -10 35 -40 0 0 0.45
photo photos/12.png 5 5 20 0 0 0.6
ffmpeg -v fatal -i "$demo/session/observer.mkv" clip/%04d.png
environment >room.hdr
cp "$demo/virtual.glb" .
cat >my.toml <<'SET'
[set]
name = "first day"
[observer]
[tracking]
family = "tag36h11"
[lighting]
environment = "room.hdr"
[[object]]
name = "spheres"
file = "virtual.glb"
presence = "virtual"
SET
cat >frames.json <<'FRAMES'
{ "name": "first day", "set": "my.toml",
  "observer": { "pictures": "clip/%04d.png", "fps": 6, "exposure": 1 } }
FRAMES

step 0 "$previz" calibrate observer photos --board chessboard:9x6:25mm --set my.toml --write
# Six pictures are no walk: that is said, and a ruler gives the tags' places.
step 1 "$previz" calibrate tags clip --set my.toml --size 80mm --write
expect "these views are missing"
sed -n '/^\[\[tag\]\]/,/^$/p' "$demo/demo.toml" >>my.toml
step 0 "$previzd" check my.toml
step 0 "$previz" model clip --set my.toml --pictures marks
step 0 "$previz" import frames.json take

# The manual's order, "THE LIGHT": the model in grey, how the HDRI is turned, how bright it is, the model's colours.
step 0 "$previz" model take --set my.toml --parts "$demo/real.toml" --out real.glb --grey --write
step 0 "$previzd" check take --set my.toml
expect "calibrate balance"
step 0 "$previz" calibrate light take --rotation --set my.toml --write
step 0 "$previz" calibrate balance take --set my.toml --write
step 0 "$previz" model take --set my.toml --parts "$demo/real.toml" --out real.glb
step 0 "$previz" render take --set my.toml --frames 0 --spp 16 --out pictures
never "times as bright as the picture"
[[ -s pictures/0000.png && -s pictures/0000.exr && -s pictures/review.mp4 ]] || fail "render left no picture, layers or movie"
