#!/usr/bin/env bash
# Installs what the test of the executor `slurm` needs: Debian's Slurm and munge. Starts no service. Without apt or root it says so and
# succeeds: the test is then skipped.
set -euo pipefail

have() {
    for program in munged slurmctld slurmd sbatch; do
        command -v "$program" >/dev/null || return 1
    done
}

# Where Debian puts daemons, which is not in every user's search path.
PATH="$PATH:/usr/sbin:/sbin"
if have; then
    exit 0
fi
if ! command -v apt-get >/dev/null || [ "$(id -u)" != 0 ]; then
    echo "Slurm is not installed: needs apt-get and root" >&2
    exit 0
fi
# A package that starts its service would start it as nobody wants it: with the configuration of another cluster, or with none.
export DEBIAN_FRONTEND=noninteractive RUNLEVEL=1
apt-get update -qq &&
    apt-get install -y -qq --no-install-recommends slurm-wlm munge >/dev/null ||
    echo "Slurm is not installed: apt-get failed" >&2
