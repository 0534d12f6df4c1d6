#!/usr/bin/env bash
# Runs a command in a Debian 13 of the project's own, which it makes in build/debian13/root where it is missing:
#   tests/debian13/inside.sh [--show FOLDER]... COMMAND...
# As root. The project is seen inside at its own path, and so is every FOLDER, an absolute path. The mounts are in a
# namespace of their own and end with the command.
set -euo pipefail
project=$(cd "$(dirname "$0")/../.." && pwd)
root=$project/build/debian13/root

if [[ $EUID -ne 0 ]]; then
  echo "debian13: run it as root, which it needs for mounts and chroot" >&2
  exit 1
fi
for tool in mmdebstrap unshare; do
  [[ $tool == mmdebstrap && -e $root/etc/debian_version ]] && continue
  command -v "$tool" >/dev/null && continue
  echo "debian13: $tool is missing; apt-get install mmdebstrap util-linux" >&2
  exit 1
done

if [[ ! -e $root/etc/debian_version ]]; then
  # shellcheck disable=SC2016  # the format is apt's
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian' | head -n 1)
  [[ -n $mirror ]] || { echo "debian13: the package sources have no archive of Debian" >&2; exit 1; }
  rm -rf "$root.part"
  mkdir -p "${root%/*}"
  mmdebstrap --quiet --variant=minbase --aptopt='APT::Install-Recommends "false"' \
    --include=ca-certificates trixie "$root.part" "deb $mirror trixie main" >&2
  mv "$root.part" "$root"
fi

shown=("$project")
while [[ ${1-} == --show ]]; do
  shown+=("$2")
  shift 2
done
# shellcheck disable=SC2016  # the inner shell expands them
exec unshare --mount bash -ec '
  root=$1 project=$2 count=$3
  for folder in "${@:4:count}"; do
    mkdir -p "$root$folder"
    mount --bind "$folder" "$root$folder"
  done
  mount --rbind /dev "$root/dev"
  mount -t proc proc "$root/proc"
  mount -t tmpfs run "$root/run"
  exec chroot "$root" env --chdir="$project" HOME=/root "${@:4+count}"' - "$root" "$project" "${#shown[@]}" \
  "${shown[@]}" "$@"
