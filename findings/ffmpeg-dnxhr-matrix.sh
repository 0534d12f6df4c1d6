#!/usr/bin/env bash
# The frames of a DNxHR HQ clip of FFmpeg name the BT.709 matrix, whatever matrix its encoder was told.
#
# One would expect the matrix that the encoder is given to come back from the decoder, as with H.264,
# or "unspecified", as with ProRes. For 4:2:2 of 8 bits the decoder reports bt709, also where the encoder
# was told smpte170m or bt2020nc. Pure red that was coded by BT.601 (luma 0.299, red difference 0.5) is
# 0.299 + 0.5 * 1.5748 = 1.086 for whoever decodes it by BT.709.
# Seen with FFmpeg N-47683 of 2018 and ffprobe N-66595 of 2023 (npm @ffmpeg-installer/linux-x64 4.1.0,
# @ffprobe-installer/linux-x64 5.2.0) on 2026-11-29. With Debian 12's FFmpeg 5.1.9 the container's colr
# atom has the right matrix, which ffprobe prints for the stream, and frames still say bt709.
# What helps: where the container names a matrix for DNxHD or DNxHR, use that one.
#
# Needs npm. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init --yes >/dev/null
npm install --silent --no-audit --no-fund @ffmpeg-installer/linux-x64@4.1.0 @ffprobe-installer/linux-x64@5.2.0
ffmpeg=node_modules/@ffmpeg-installer/linux-x64/ffmpeg
ffprobe=node_modules/@ffprobe-installer/linux-x64/ffprobe
chmod +x "$ffmpeg" "$ffprobe"
"$ffprobe" -version | head -1
for matrix in smpte170m bt709 bt2020nc; do
  "$ffmpeg" -v error -y -f lavfi -i testsrc=s=320x240 -frames:v 1 -pix_fmt yuv422p \
    -colorspace "$matrix" -c:v dnxhd -profile:v dnxhr_hq "$matrix.mov"
  frame=$("$ffprobe" -v error -show_entries frame=color_space -of csv=p=0 "$matrix.mov" | head -1)
  echo "encoder was told $matrix: the frame says $frame"
  [[ $frame == bt709 ]] || { echo "changed"; exit 1; }
done
