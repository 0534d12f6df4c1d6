#!/usr/bin/env bash
# previzd in Debian 13, whose compiler, libraries and Mesa are newer than those of Debian 12: installs what
# config/install-deps.sh names, builds, runs the tests, renders a frame of the demo, and installs the
# package, in a Debian that is made for this. As root; half an hour, and the network.
#   tests/debian13/run.sh            all of it
#   tests/debian13/run.sh TARGET...  builds these only, and runs those of them that are tests
# Debian and build are kept in build/debian13.
set -euo pipefail
cd "$(dirname "$0")/../.."
root=build/debian13/root build=build/debian13/build
targets=("$@")

if [[ $EUID -ne 0 ]]; then
  echo "debian13: run it as root, which it needs for mounts and chroot" >&2
  exit 1
fi
for tool in mmdebstrap unshare; do
  command -v "$tool" >/dev/null && continue
  echo "debian13: $tool is missing; apt-get install mmdebstrap util-linux" >&2
  exit 1
done

if [[ ! -e $root/etc/debian_version ]]; then
  # shellcheck disable=SC2016  # the format is apt's
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian' | head -n 1)
  [[ -n $mirror ]] || { echo "debian13: the package sources have no archive of Debian" >&2; exit 1; }
  rm -rf "$root.part"
  mkdir -p build/debian13
  mmdebstrap --quiet --variant=minbase --aptopt='APT::Install-Recommends "false"' \
    --include=ca-certificates trixie "$root.part" "deb $mirror trixie main"
  mv "$root.part" "$root"
fi

# Runs a command in it, with the project at its own path. The mounts are in a namespace of their own
# and end with the command.
inside() {
  # shellcheck disable=SC2016  # the inner shell expands them
  unshare --mount bash -ec '
    root=$1 project=$2
    mkdir -p "$root$project"
    mount --bind "$project" "$root$project"
    mount --rbind /dev "$root/dev"
    mount -t proc proc "$root/proc"
    mount -t tmpfs run "$root/run"
    exec chroot "$root" env --chdir="$project" HOME=/root "${@:3}"' - "$root" "$PWD" "$@"
}

inside config/install-deps.sh
inside git config --global --replace-all safe.directory '*'
inside cmake --preset release -B "$build" -DPREVIZ_GATE="${PREVIZ_GATE:-OFF}" --log-level=WARNING
only=()
[[ ${#targets[@]} -eq 0 ]] || only=(--target "${targets[@]}")
inside cmake --build "$build" --parallel "$(nproc)" "${only[@]}"

names=$(IFS='|' && echo "${targets[*]#test_}")
[[ -z $names ]] || names="^($names)$"
inside ctest --test-dir "$build" --parallel "$(($(nproc) + 1))" --output-on-failure --label-exclude long \
  --tests-regex "${names:-.}"
[[ ${#targets[@]} -eq 0 ]] || exit 0

inside "$build/daemon/previzd" render config/demo/session --set config/demo/demo.toml --out "$build/demo" \
  --frames 0 --spp 4 --no-video --force
inside cmake --build "$build" --target deb
# shellcheck disable=SC2016
inside bash -ec 'apt-get install --yes --quiet --no-install-recommends "$1"/previzd_*.deb >/dev/null
  previzd check config/demo/demo.toml
  apt-get purge --yes --quiet previzd >/dev/null' - "$PWD/$build"
echo "debian13: passed, in Debian $(<"$root/etc/debian_version")"
