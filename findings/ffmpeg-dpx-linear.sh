#!/usr/bin/env bash
# FFmpeg's DPX encoder calls every picture linear, whatever its colour tags say.
#
# A DPX header names the transfer characteristic of its samples in byte 801 (SMPTE ST 268: 2 linear,
# 6 ITU-R 709, ...). One would expect FFmpeg to write there what the frame's color_trc says, as its
# other encoders do. It writes 2, linear, and 2 into the colorimetric byte 802, for BT.709, sRGB and
# unspecified pictures alike, and leaves the codes as they are. A reader that heeds the tag shows
# such a DPX far too bright: code 400 of 1023 becomes 0.66 of white in place of 0.39. FFmpeg's own
# decoder reports color_transfer=linear for it.
# Seen with FFmpeg N-47683 of 2018 (npm @ffmpeg-installer/linux-x64 4.1.0) on 2026-11-29; Debian 12's
# FFmpeg 5.1.9 does the same. What helps: whoever reads DPX looks at the creator field (offset 160),
# which begins with "Lavc", and does not believe the tag.
#
# Needs npm. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init --yes >/dev/null
npm install --silent --no-audit --no-fund @ffmpeg-installer/linux-x64@4.1.0
ffmpeg=node_modules/@ffmpeg-installer/linux-x64/ffmpeg
chmod +x "$ffmpeg"
"$ffmpeg" -version | head -1
for trc in bt709 iec61966-2-1 linear; do
  "$ffmpeg" -v error -y -f lavfi -i color=c=0x646464:s=16x16 -frames:v 1 -pix_fmt gbrp10be \
    -color_trc "$trc" -color_primaries bt709 "$trc.dpx"
  creator=$(tail -c +161 "$trc.dpx" | head -c 4)
  bytes=$(od -An -tu1 -j801 -N2 "$trc.dpx" | xargs)
  echo "asked for $trc: creator $creator, transfer and colorimetric bytes $bytes"
  [[ $creator == Lavc && $bytes == "2 2" ]] || { echo "changed"; exit 1; }
done
cmp bt709.dpx linear.dpx && echo "the files are the same byte for byte"
