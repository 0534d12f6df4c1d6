#!/usr/bin/env bash
# Brings the compilers of AMD's, Intel's and NVIDIA's GPUs to a machine without any: Mesa's drivers as
# Debian 13 has them, and stubs of the kernel's drivers for Intel and NVIDIA, which are in Mesa's source for
# this purpose (RADV needs none). As root; five minutes, the network and 1.5 GB.
#   tests/gpu_code/drivers.sh FOLDER                        makes them
#   tests/gpu_code/drivers.sh FOLDER GPU INSIDE COMMAND...  runs a command on one of them, in that
#     Debian, with the folder INSIDE as /work, where it begins
#     GPU: radv:NAME (navi31 = RX 7900), anv:PCI_ID (0x56a0 = Arc A770), nvk:CHIP (193 = RTX 4080)
set -euo pipefail
root=$(realpath -m "$1")
shift

make_drivers() {
  local mirror
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian' | head -n 1)
  [[ -n $mirror ]] || { echo "gpu_code: the package sources have no archive of Debian" >&2; exit 1; }
  rm -rf "$root.part"
  mmdebstrap --quiet --variant=minbase --aptopt='APT::Install-Recommends "false"' \
    --include=ca-certificates,mesa-vulkan-drivers,libvulkan1 trixie "$root.part" \
    "deb $mirror trixie main" "deb-src $mirror trixie main"
  cat >"$root.part/root/stubs.sh" <<'STUBS'
set -eo pipefail
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq
apt-get install -y --no-install-recommends dpkg-dev meson ninja-build gcc g++ python3-mako \
  python3-packaging python3-yaml libdrm-dev bison flex pkg-config zlib1g-dev libzstd-dev \
  libexpat1-dev glslang-tools libelf-dev libudev-dev >/dev/null
mkdir /root/source
cd /root/source
apt-get source -qq mesa >/dev/null
cd mesa-*/
# As far as a compiler asks, Ada's chips (19x) have the classes of Ampere's.
sed -i 's/^\( *\)case 0x170:$/\1case 0x190: case 0x170:/' src/nouveau/drm-shim/nouveau_noop.c
meson setup build -Dtools=drm-shim,intel -Dgallium-drivers=crocus,nouveau -Dvulkan-drivers= \
  -Dplatforms= -Dglx=disabled -Degl=disabled -Dgbm=disabled -Dopengl=false -Dgles1=disabled \
  -Dgles2=disabled -Dllvm=disabled -Dvalgrind=disabled -Dlibunwind=disabled -Dbuildtype=release \
  -Dshared-glapi=disabled -Dxmlconfig=disabled >/dev/null
stubs="src/intel/tools/libintel_noop_drm_shim.so src/nouveau/drm-shim/libnouveau_noop_drm_shim.so"
ninja -C build $stubs | tail -n 1
mkdir -p /opt/stubs
for stub in $stubs; do cp "build/$stub" /opt/stubs/; done
dpkg-query -W -f '${Version}\n' mesa-vulkan-drivers >/opt/stubs/mesa_version
rm -rf /root/source
STUBS
  mkdir -p "$root.part/work"
  chroot "$root.part" bash /root/stubs.sh
  rm -rf "$root"
  mv "$root.part" "$root"
}

# The mounts are in a namespace of their own and end with the command.
run_on() {
  local gpu=$1 inside
  inside=$(realpath "$2")
  local icd=/usr/share/vulkan/icd.d settings=(MESA_SHADER_CACHE_DISABLE=true)
  case $gpu in
    radv:*) settings+=("RADV_FORCE_FAMILY=${gpu#*:}" RADV_DEBUG=nocache "VK_DRIVER_FILES=$icd/radeon_icd.json") ;;
    anv:*) settings+=("INTEL_STUB_GPU_DEVICE_ID=${gpu#*:}" "VK_DRIVER_FILES=$icd/intel_icd.json"
      LD_PRELOAD=/opt/stubs/libintel_noop_drm_shim.so) ;;
    nvk:*) settings+=("NOUVEAU_CHIPSET=${gpu#*:}" NVK_I_WANT_A_BROKEN_VULKAN_DRIVER=1
      "VK_DRIVER_FILES=$icd/nouveau_icd.json" LD_PRELOAD=/opt/stubs/libnouveau_noop_drm_shim.so) ;;
    *)
      echo "gpu_code: no GPU \"$gpu\"; there are radv:NAME, anv:PCI_ID and nvk:CHIP" >&2
      exit 2
      ;;
  esac
  # shellcheck disable=SC2016  # the inner shell expands them
  unshare --mount bash -ec '
    root=$1 inside=$2
    mount --bind "$inside" "$root/work"
    mount --bind /dev "$root/dev"
    mount -t proc proc "$root/proc"
    exec chroot "$root" env --chdir=/work "${@:3}"' - "$root" "$inside" "${settings[@]}" "${@:3}"
}

if [[ $# -eq 0 ]]; then make_drivers; else run_on "$@"; fi
