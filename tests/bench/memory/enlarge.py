#!/usr/bin/env python3
"""Writes the demo's take with pictures of another size, a multiple of its 640 in width and cut in height.

    enlarge.py DEMO_SESSION OUT WIDTH HEIGHT      (needs ffmpeg and ffprobe)
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import zlib


def output_of(*command):
    return subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout


def packets_of(video):
    """The packets' bytes, whose CRC-32 is in the line of their frame."""
    sizes = output_of("ffprobe", "-v", "error", "-show_entries", "packet=size", "-of", "default=nk=1:nw=1", video)
    stream = output_of("ffmpeg", "-v", "error", "-i", video, "-c", "copy", "-f", "rawvideo", "-")
    first = 0
    for size in map(int, sizes.split()):
        yield stream[first:first + size]
        first += size


def main():
    demo, out = map(pathlib.Path, sys.argv[1:3])
    width, height = map(int, sys.argv[3:5])
    times = width // 640
    cut = (480 * times - height) // 2
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(demo, out)
    video = out / "observer.mkv"
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", demo / "observer.mkv", "-vf",
                    f"scale={width}:{480 * times}:flags=lanczos,crop={width}:{height}:0:{cut}",
                    "-c:v", "ffv1", "-level", "3", "-slices", "24", "-slicecrc", "1", "-g", "1", "-pix_fmt", "bgr0",
                    "-fps_mode", "passthrough", "-enc_time_base", "1/1000", video], check=True)
    frames = [json.loads(line) for line in (demo / "observer.jsonl").read_text().splitlines()]
    for frame, packet in zip(frames, packets_of(video), strict=True):
        frame["crc32"] = f"{zlib.crc32(packet):08x}"
    (out / "observer.jsonl").write_text("".join(json.dumps(frame) + "\n" for frame in frames))

    before, begin, of_observer = (demo / "session.toml").read_text().partition("[observer.video]")
    of_observer, end, after = of_observer.partition("[light.calibration]")
    for key, value in {"width": width, "height": height, "fx": 640.0 * times, "fy": 640.0 * times,
                       "cx": 316.7 * times - 0.5, "cy": 244.3 * times - 0.5 - cut}.items():
        of_observer = re.sub(rf"^{key} = .*$", f"{key} = {value}", of_observer, flags=re.MULTILINE)
    (out / "session.toml").write_text(before + begin + of_observer + end + after)


main()
