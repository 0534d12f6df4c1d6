#!/usr/bin/env bash
# Builds gpio-sim for Debian's 6.1 kernel, which ships it no more than CONFIG_IRQ_SIM, from Debian's
# own kernel source of the same version.   build_modules.sh DIRECTORY   leaves *.ko and kver there.
set -euo pipefail
to=$1
kver=$(basename "$(find /usr/src -maxdepth 1 -name 'linux-headers-6.1*-amd64' ! -name '*cloud*' \
  ! -name '*rt*' | sort -V | tail -1)" | sed 's/^linux-headers-//')
version=$(dpkg-query -W -f='${Version}' "linux-headers-$kver")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

(cd "$work" && apt-get -qq -o APT::Sandbox::User=root download "linux-source-6.1=$version")
# Only these of the tree's 1.3 GB are needed.
dpkg-deb --fsys-tarfile "$work"/linux-source-6.1_*.deb |
  tar xO ./usr/src/linux-source-6.1.tar.xz | xz -dc |
  tar x -C "$work" --strip-components=3 linux-source-6.1/drivers/gpio/gpio-sim.c \
    linux-source-6.1/drivers/gpio/gpiolib.h linux-source-6.1/kernel/irq/irq_sim.c

# irq_sim.c takes itself for a part of the kernel: irq_to_desc() is not there for modules (the same
# descriptor by its irq_data is), and a module states its licence.
sed -i 's/irq_to_desc(irqnum)/irq_data_to_desc(irq_get_irq_data(irqnum))/' "$work/irq_sim.c"
printf '#include <linux/module.h>\nMODULE_LICENSE("GPL v2");\n' >>"$work/irq_sim.c"
echo 'obj-m := irq_sim.o gpio-sim.o' >"$work/Kbuild"
make -s -C "/usr/src/linux-headers-$kver" M="$work" modules
mkdir -p "$to"
cp "$work"/*.ko "$to"
echo "$kver" >"$to/kver"
