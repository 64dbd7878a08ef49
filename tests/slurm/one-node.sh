#!/usr/bin/env bash
# A Slurm cluster of one node for tests and for trying things out: its own key, configuration, ports and state, all in one folder, beside
# whatever other Slurm there is.
#
#     tests/slurm/one-node.sh start DIR     starts it, or what of it is not running; then: export SLURM_CONF=DIR/slurm.conf
#     tests/slurm/one-node.sh stop DIR      stops it
#
# CPUS=N gives the node N processors, whatever the machine has [default: 2]. DIR must be short: it holds sockets, whose paths are limited to 107
# characters.
set -euo pipefail
PATH="$PATH:/usr/sbin:/sbin"

usage() {
    echo "usage: $0 start|stop DIR" >&2
    exit 2
}
[ $# = 2 ] || usage
verb=$1
mkdir -p "$2"
dir=$(cd "$2" && pwd)
export SLURM_CONF="$dir/slurm.conf"

# Whether a process is at work. One that has ended and that nobody has asked about is still listed, in containers for ever.
alive() {
    kill -0 "$1" 2>/dev/null && ! grep -q '^State:[[:space:]]*Z' "/proc/$1/status" 2>/dev/null
}

# Whether the daemon that wrote this file of its process id is running.
running() {
    [ -s "$dir/$1.pid" ] && alive "$(cat "$dir/$1.pid")"
}

free_ports() {
    python3 - 2>/dev/null <<'PY' || echo 16817 16818
import socket
sockets = [socket.socket() for _ in range(2)]
for one in sockets:
    one.bind(("127.0.0.1", 0))
print(*(one.getsockname()[1] for one in sockets))
PY
}

configure() {
    local user ports
    user=$(id -un)
    read -r -a ports <<<"$(free_ports)"
    mkdir -p "$dir/state" "$dir/spool"
    # munge refuses a key that others may read.
    (umask 077 && head -c 1024 /dev/urandom >"$dir/munge.key")
    cat >"$SLURM_CONF" <<CONF
ClusterName=one-node
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=${ports[0]}
SlurmdPort=${ports[1]}
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
# A task that is queued again waits until its old credential has expired: two minutes, if left alone.
AuthInfo=socket=$dir/munge.socket,cred_expire=20
CredType=cred/munge
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd.log
# No cgroups: containers seldom let one make any.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
MailProg=/bin/true
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
# A node that comes back is used again, and one with fewer processors than it claims is no cause for alarm.
ReturnToService=2
SlurmdParameters=config_overrides
# Short, as this is for tests: a node that is silent for so long is down, and its tasks are queued again.
SlurmdTimeout=10
KillWait=5
SchedulerParameters=sched_interval=2,bf_interval=5,requeue_delay=1
NodeName=one NodeAddr=127.0.0.1 CPUs=${CPUS:-2} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
}

# Starts a daemon that holds on to none of our pipes: whoever reads this script's output would wait for the daemon to end.
daemon() {
    "$@" </dev/null >>"$dir/start.log" 2>&1 || {
        echo "$1 does not start: see $dir/start.log" >&2
        exit 1
    }
}

start() {
    for program in munged slurmctld slurmd sbatch; do
        command -v "$program" >/dev/null || {
            echo "$program is missing: tests/slurm/install.sh installs it on Debian" >&2
            exit 1
        }
    done
    [ -e "$SLURM_CONF" ] || configure
    # --force: that a parent folder may be written by others, as /tmp may, is none of our business here.
    running munged || daemon munged --force --key-file="$dir/munge.key" --socket="$dir/munge.socket" --pid-file="$dir/munged.pid" \
        --log-file="$dir/munged.log" --seed-file="$dir/munged.seed"
    running slurmctld || daemon slurmctld -f "$SLURM_CONF"
    running slurmd || daemon slurmd -f "$SLURM_CONF" -N one
    # A node whose tasks were killed is "completing" for a while, and a busy machine takes its time.
    local state=unknown
    for _ in $(seq 300); do
        state=$(timeout 5 sinfo --noheader --format=%T 2>/dev/null || true)
        case $state in
        idle* | mixed* | allocated* | completing*) exit 0 ;;
        esac
        sleep 0.2
    done
    echo "the node did not come up, its state is '$state': see $dir/slurmctld.log and $dir/slurmd.log" >&2
    tail -n 20 "$dir/slurmctld.log" "$dir/slurmd.log" >&2 || true
    exit 1
}

stop() {
    for daemon in slurmd slurmctld munged; do
        if running "$daemon"; then
            pid=$(cat "$dir/$daemon.pid")
            kill "$pid"
            for _ in $(seq 50); do
                alive "$pid" || break
                sleep 0.1
            done
            kill -9 "$pid" 2>/dev/null || true
        fi
    done
}

case $verb in
start) start ;;
stop) stop ;;
*) usage ;;
esac
