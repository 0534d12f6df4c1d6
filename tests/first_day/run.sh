#!/usr/bin/env bash
# First days with previzd, as programs: each types what README and manual tell a student, an operator and a director to type, on
# a terminal, and reads the answers. A command that shows nothing for more than two seconds fails the day. Five minutes on two
# idle cores, which it needs for itself.
#   tests/first_day/run.sh [student|operator|director]...
set -euo pipefail
cd "$(dirname "$0")/../.."
config/install-deps.sh ffmpeg poppler-utils dbus bsdutils
cmake --preset release --log-level=WARNING
cmake --build --preset release --parallel "$(nproc)" --target previzd previz previzctl
[[ $# -gt 0 ]] || set -- student operator director
for day in "$@"; do
  printf '\n== the first day of a%s %s ==\n' "$([[ $day != operator ]] || echo n)" "$day"
  "tests/first_day/$day.sh"
done
