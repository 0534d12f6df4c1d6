# Runs as root in the bare Debian that run.sh makes, where no systemd runs.
set -euo pipefail
cd /tmp/package
export DEBIAN_FRONTEND=noninteractive

step() { echo "== $* =="; }
fail() {
  echo "tests/package: $*" >&2
  exit 1
}
files() { find / -xdev \( -path /proc -o -path /sys -o -path /tmp -o -path /dev \) -prune -o -print | sort; }

# purges_without_trace PACKAGE: whether a purge leaves nothing of what PACKAGE.deb installs.
purges_without_trace() {
  files >before
  dpkg --install "$1.deb"
  dpkg --purge "$1"
  files >after
  # Both lists are sorted. dpkg's own records and the backups of the user lists are not the package's.
  comm -13 before after >new
  sed -i -e '\|/var/lib/dpkg|d' -e '\|/etc/group-|d' -e '\|/etc/passwd-|d' -e '/shadow-/d' new
  [[ ! -s new ]] || fail "purge left: $(cat new)"
}

step "install the tools"
apt-get install --quiet=2 ./previz-tools.deb >apt.log 2>&1 || { cat apt.log; fail "the tools do not install"; }
previz --version
previz farm --help >/dev/null
[[ -z $(find / -xdev -path /tmp -prune -o -path '*/system/previz*' -print) ]] || fail "the tools have a systemd unit"
[[ ! -e /etc/previzd && ! -e /var/lib/previzd ]] || fail "the tools have the rig's folders"
! id previz 2>/dev/null || fail "the tools made the user previz"
bash -c 'source /usr/share/bash-completion/completions/previz; complete -p previz' >/dev/null

step "a job without a scheduler"
previz farm demo/session --set demo/demo.toml --frames 0-1 --scale 0.1 --spp 1 --cpu --out finished | tee plan
grep -qF 'There is no Slurm here' plan || fail "the plan does not say how the job is started"
bash finished.farm/loop.sh
for file in 0000.png 0000.exr 0001.png 0001.exr; do
  [[ -s finished/$file ]] || fail "the job has not made $file"
done
previz farm status finished.farm | grep -qF '2 of 2 frames done' || fail "the job is not done"

step "purge the tools"
dpkg --purge previz-tools
purges_without_trace previz-tools
# What the rig's package needs is not to be there for the tools' sake.
apt-get autoremove --purge --quiet=2 >apt.log 2>&1 || { cat apt.log; fail "autoremove fails"; }

step "install"
apt-get install --quiet=2 ./previzd.deb >apt.log 2>&1 || { cat apt.log; fail "does not install"; }
previzd --version
# The set that the unit names, which is the conffile.
previzd check "$(sed -n 's/^ExecStart=.* //p' /lib/systemd/system/previzd.service)"
previzctl actions --names | grep -qx refine
id previz | grep -q video || fail "the user previz may not open cameras"
! id previz | grep -q input || fail "the user previz may read keyboards"
# As the package makes it, and as systemd, which does not run here, keeps it from the first start on.
[[ $(stat -c '%U %a' /var/lib/previzd) == "previz 750" ]] || fail "/var/lib/previzd: wrong owner"
grep -qx StateDirectoryMode=0750 /lib/systemd/system/previzd.service || fail "the service would open /var/lib/previzd"
systemctl is-enabled --quiet previzd.service || fail "the service is not enabled"
# That it can be started: every program, user and key that its unit names.
systemd-analyze verify --man=no previzd.service
bash -c 'source /usr/share/bash-completion/completions/previzd; complete -p previzd' >/dev/null

[[ -x /usr/lib/previzd/await-restart ]] || fail "nothing makes the service wait between starts"
perl -c /etc/needrestart/conf.d/previzd.conf 2>/dev/null || fail "needrestart cannot read its file"

step "the demonstration set renders"
mkdir -m 777 pictures
setpriv --reuid=previz --regid=previz --init-groups env XDG_CACHE_HOME=/tmp \
  previzd --log-level warning run /etc/previzd/set.toml --spp 1 --out pictures
[[ -s pictures/picture.png ]] || fail "no picture"

step "upgrade, with a set that was changed"
echo '# ours' >>/etc/previzd/set.toml
systemctl disable --quiet previzd.service
usermod --append --groups input previz # as earlier versions had it
dpkg --force-confdef --install later.deb
! id previz | grep -q input || fail "after the upgrade the user previz may still read keyboards"
grep -qx '# ours' /etc/previzd/set.toml || fail "the upgrade lost the changed set"
[[ -f /etc/previzd/set.toml.dpkg-dist ]] || fail "the later default set is not beside it"
! systemctl is-enabled --quiet previzd.service || fail "the upgrade enabled a disabled service"

step "remove"
dpkg --remove previzd
[[ -f /etc/previzd/set.toml ]] || fail "remove took the configuration"
[[ ! -e /usr/bin/previzd ]] || fail "remove left the program"

step "purge, with a take"
mkdir -p /var/lib/previzd/takes/1
dpkg --purge previzd
[[ -d /var/lib/previzd/takes/1 ]] || fail "purge took a recorded take"
rm -r /var/lib/previzd

step "install, and purge"
purges_without_trace previzd

step "the tools beside the rig"
dpkg --install previzd.deb
! previzd takes list /var/lib/previzd 2>refusal || fail "previzd has tools of its own"
grep -q 'install the package previz-tools' refusal || fail "who misses the tools is not told where they are"
apt-get install --quiet=2 ./previz-tools.deb >apt.log 2>&1 || { cat apt.log; fail "the tools do not go with the rig"; }
previzd takes list /usr/share/previzd/demo
