#!/usr/bin/env bash
# A real Slurm cluster on this machine, without systemd: munged, slurmctld and one slurmd a node, on loopback. As root.
#   tests/farm/cluster.sh up DIR NODES             starts it and waits until every node is idle; . DIR/env then makes
#                                                  sbatch, squeue and the others talk to it
#   tests/farm/cluster.sh kill-node DIR K          the power of node K fails: all that runs there ends
#   tests/farm/cluster.sh cut-node DIR K           its network fails: only its slurmd ends, its steps run on
#   tests/farm/cluster.sh start-node DIR K         the node is back, with the steps that a cut has left running
#   tests/farm/cluster.sh on-node DIR K COMMAND... runs a command among the node's processes and mounts
#   tests/farm/cluster.sh down DIR                 ends all of it; the logs, the queue and the spool folders stay in DIR
# Each node has PID, mount and UTS namespaces of its own, so that killing its first process ends all that it runs, a
# disk can be missing on it, and its host name is its own. Processes of two nodes may have the same number.
# DIR is at most 50 plain characters long, since Slurm's sockets lie in it.
# Variables: CLUSTER_PORT, the controller's (26900; node K has the one K above, srun those from 100 above),
# CLUSTER_CPUS of a node (1), CLUSTER_MEMORY_MB of a node (16384), CLUSTER_CONF, a file of further lines for slurm.conf.
set -euo pipefail

fail() {
  echo "cluster: $*" >&2
  exit 1
}

usage() {
  sed -n 's/^#   tests\/farm\///p' "$0" >&2
  exit 2
}

# The time at which a process began, in ticks since boot, which tells it from a later one of the same number.
# Nothing for a process that has ended.
began() {
  local stat fields
  { stat=$(<"/proc/$1/stat"); } 2>/dev/null || return 0
  read -r -a fields <<<"${stat##*) }"
  [[ ${fields[0]} == [ZX] ]] || echo "${fields[19]}"
}

# launch NAME COMMAND...: starts a daemon and notes its process in run/NAME.
launch() {
  local name=$1
  setsid nice -n 5 "${@:2}" </dev/null >>"$dir/log/$name.out" 2>&1 &
  echo "$! $(began $!)" >"$dir/run/$name"
}

# The process of a daemon that this script has started, if it still runs.
process_of() {
  local pid start
  [[ -e $dir/run/$1 ]] || return 0
  read -r pid start <"$dir/run/$1"
  [[ -z $start || $(began "$pid") != "$start" ]] || echo "$pid"
}

has_ended() { [[ -z $(process_of "$1") ]]; }

# await SECONDS COMMAND...: runs a command until it succeeds; fails after that many seconds.
await() {
  local end=$((SECONDS + $1))
  until "${@:2}"; do
    ((SECONDS < end)) || return 1
    sleep 0.1
  done
}

# end SIGNAL NAME: ends a daemon, by force after five seconds.
end() {
  local pid
  pid=$(process_of "$2")
  if [[ -n $pid ]]; then
    kill -s "$1" "$pid" 2>/dev/null || true
    await 5 has_ended "$2" || kill -s KILL "$pid" 2>/dev/null || true
    await 5 has_ended "$2" || fail "process $pid ($2) cannot be ended"
  fi
  rm -f "$dir/run/$2"
}

# The first process of a node's namespaces.
first_process() {
  local unshare
  unshare=$(process_of "node$1")
  [[ -z $unshare ]] || pgrep --parent "$unshare" || true
}

has_power() { [[ -n $(first_process "$1") ]]; }
has_name() { [[ $(on_node "$1" hostname 2>/dev/null) == "node$1" ]]; }

on_node() {
  local first
  first=$(first_process "$1")
  [[ -n $first ]] || fail "node$1 has no power; start it by: cluster.sh start-node $dir $1"
  nsenter --target "$first" --pid --uts --mount -- "${@:2}"
}

has_daemon() {
  # shellcheck disable=SC2016  # the node's shell expands it
  on_node "$1" bash -c 'read -r comm <"/proc/$(<"$1")/comm" && [[ $comm == slurmd ]]' - \
    "$dir/run/slurmd_node$1.pid" 2>/dev/null
}

# The first process waits for nothing and adopts, as a machine's does, what the steps leave behind.
start_node() {
  if ! has_power "$1"; then
    # shellcheck disable=SC2016  # the node's shell expands it
    launch "node$1" unshare --pid --uts --fork --kill-child=KILL --mount-proc --propagation slave \
      bash -c 'mount --bind "$2" /etc/hosts; hostname "$1"; sleep infinity & wait' - "node$1" "$dir/hosts"
    await 10 has_name "$1" || fail "node$1 gets no namespaces of its own; see $dir/log/node$1.out"
  fi
  ! has_daemon "$1" || fail "node$1 runs already"
  rm -f "$dir/run/slurmd_node$1.pid"
  # Without -D the daemon leaves this script by itself.
  on_node "$1" nice -n 5 slurmd -N "node$1" -f "$dir/slurm.conf" </dev/null >>"$dir/log/node$1.out" 2>&1
  await 10 has_daemon "$1" || fail "the slurmd of node$1 does not start; see $dir/log/slurmd_node$1.log"
}

# A cut daemon leaves no time to say goodbye to its steps or to the controller.
cut_node() {
  has_daemon "$1" || fail "node$1 runs no slurmd"
  # shellcheck disable=SC2016
  on_node "$1" bash -c 'kill -s KILL "$(<"$1")"' - "$dir/run/slurmd_node$1.pid"
  rm -f "$dir/run/slurmd_node$1.pid"
}

kill_node() {
  end KILL "node$1"
  rm -f "$dir/run/slurmd_node$1.pid"
}

plugins() {
  local plugin
  for plugin in /usr/lib/*/slurm-wlm/auth_munge.so /usr/lib/*/slurm/auth_munge.so; do
    [[ ! -e $plugin ]] || { dirname "$plugin"; return; }
  done
  fail "Slurm's plugins are missing; apt-get install --no-install-recommends slurm-wlm munge"
}

# cred_expire is how long a requeued task waits for its old credential to lapse (120 s by default); MinJobAge how
# long `scontrol show job` knows a job that has ended, since there is no accounting.
write_configuration() {
  local host k
  host=$(uname -n)
  host=${host%%.*}
  cat <<END_OF_CONF
ClusterName=farmtest
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SrunPortRange=$((port + 100))-$((port + 199))
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket=$dir/munge/socket,cred_expire=5
PluginDir=$(plugins)
PlugStackConfig=$dir/no_plugstack.conf
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool/%n
SlurmctldPidFile=$dir/run/slurmctld.pid
SlurmctldLogFile=$dir/log/slurmctld.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
MailProg=/bin/true
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc=$dir/log/jobs.txt
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=2
JobRequeue=1
ReturnToService=2
KillWait=3
MinJobAge=600
MaxArraySize=10001
SlurmctldTimeout=10
SlurmdTimeout=6
MessageTimeout=5
TCPTimeout=2
SlurmdPidFile=$dir/run/slurmd_%n.pid
SlurmdLogFile=$dir/log/slurmd_%n.log
END_OF_CONF
  for ((k = 1; k <= nodes; ++k)); do
    echo "NodeName=node$k NodeHostname=node$k NodeAddr=127.0.0.1 Port=$((port + k)) CPUs=${CLUSTER_CPUS:-1}" \
      "RealMemory=${CLUSTER_MEMORY_MB:-16384} State=UNKNOWN"
  done
  echo "PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP"
  [[ -z ${CLUSTER_CONF:-} ]] || cat "$CLUSTER_CONF"
}

controller_answers() { scontrol ping 2>/dev/null | grep --quiet 'is UP'; }
all_are_idle() { [[ $(sinfo --noheader --Node --format=%t | grep --count --line-regexp idle) == "$nodes" ]]; }

up() {
  local k tool
  [[ $nodes =~ ^[1-9][0-9]?$ ]] || fail "NODES is a number from 1 to 99, not \"$nodes\""
  [[ $EUID -eq 0 ]] || fail "run it as root, which it needs for namespaces and Slurm's daemons"
  for tool in munged slurmctld slurmd sbatch unshare nsenter; do
    command -v "$tool" >/dev/null ||
      fail "$tool is missing; apt-get install --no-install-recommends slurm-wlm munge util-linux"
  done
  has_ended slurmctld || fail "a cluster runs in $dir already"
  for ((k = port; k <= port + nodes; ++k)); do
    ! (: <>"/dev/tcp/127.0.0.1/$k") 2>/dev/null || fail "port $k is in use; set CLUSTER_PORT to another"
  done
  mkdir -p "$dir"/{log,run,state,spool,munge}
  chmod 755 "$dir" "$dir/munge"
  [[ -e $dir/munge/key ]] || (umask 077 && head --bytes=1024 /dev/urandom >"$dir/munge/key")
  write_configuration >"$dir/slurm.conf"
  for ((k = 1; k <= nodes; ++k)); do mkdir -p "$dir/spool/node$k"; done
  { cat /etc/hosts; for ((k = 1; k <= nodes; ++k)); do echo "127.0.0.1 node$k"; done; } >"$dir/hosts"
  echo "export SLURM_CONF=$dir/slurm.conf" >"$dir/env"

  trap down EXIT  # where one of them does not start, the others end
  launch munged munged --foreground --num-threads=2 --socket="$dir/munge/socket" --key-file="$dir/munge/key" \
    --pid-file="$dir/munge/pid" --seed-file="$dir/munge/seed" --log-file="$dir/log/munged.log"
  await 10 test -S "$dir/munge/socket" || fail "munged does not start; see $dir/log/munged.out"
  launch slurmctld slurmctld -D -f "$dir/slurm.conf"
  await 20 controller_answers || fail "slurmctld does not start; see $dir/log/slurmctld.log"
  for ((k = 1; k <= nodes; ++k)); do start_node "$k"; done
  await 30 all_are_idle || fail "not every node is idle: $(sinfo --noheader --Node --format='%N %t' | xargs)"
  trap - EXIT
}

down() {
  local run
  for run in "$dir"/run/node*; do
    [[ ! -e $run ]] || kill_node "${run##*/node}"
  done
  end TERM slurmctld
  end TERM munged
}

[[ $# -ge 2 ]] || usage
verb=$1
[[ $verb != up ]] || mkdir -p "$2"
[[ -d $2 ]] || fail "there is no folder $2"
dir=$(cd "$2" && pwd -P)
[[ $dir =~ ^[A-Za-z0-9/._-]{1,50}$ ]] ||
  fail "Slurm's sockets need a folder of at most 50 letters, digits, dots, dashes and slashes, not $dir"
export SLURM_CONF=$dir/slurm.conf
port=${CLUSTER_PORT:-26900}
case $verb in
  up) nodes=${3:?NODES} && up ;;
  down) down ;;
  kill-node | cut-node | start-node | on-node)
    grep --quiet "^NodeName=node${3:-} " "$SLURM_CONF" || fail "there is no node \"${3:-}\" in $dir"
    "${verb//-/_}" "${@:3}"
    ;;
  *) usage ;;
esac
