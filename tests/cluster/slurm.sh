#!/usr/bin/env bash
# Run a sweep on a SLURM of one node, and compare its rows with those of local processes.
#
#   sudo tests/cluster/slurm.sh [PYTHON]
#
# PYTHON is an interpreter with eidrive-scenario and its extra `cluster` (default: .venv/bin/python). The script installs
# Debian's packages slurmctld, slurmd, slurm-client and munge, writes their configuration into a temporary directory,
# starts them without systemd, and stops them at its end. It needs root, since slurmd starts jobs of other users.
set -euo pipefail
root="$(cd "$(dirname "$0")/../.." && pwd)"
python="$(realpath -s "${1:-$root/.venv/bin/python}")"
[ "$(id -u)" = 0 ] || { echo "slurm.sh needs root" >&2; exit 2; }
for command in slurmctld slurmd sbatch munged; do
    command -v "$command" > /dev/null && continue
    apt-get update -qq
    apt-get install -y -qq --no-install-recommends slurmctld slurmd slurm-client munge
    break
done

work="$(mktemp -d)"
host="$(hostname -s)"
chmod 755 "$work"
mkdir -p "$work/state" "$work/spool" "$work/dask" /run/munge
chown slurm: "$work/state"
chown munge: /run/munge
chmod 755 /run/munge
[ -s /etc/munge/munge.key ] || { dd if=/dev/urandom bs=1024 count=1 of=/etc/munge/munge.key status=none; }
chown munge: /etc/munge/munge.key
chmod 400 /etc/munge/munge.key

export SLURM_CONF="$work/slurm.conf"
cat > "$SLURM_CONF" << EOF
ClusterName=eidrive
SlurmctldHost=$host(127.0.0.1)
SlurmUser=slurm
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$(awk '/MemTotal/ {print int($2 / 1024 * 0.8)}' /proc/meminfo)
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
EOF

stop() {
    for file in "$work/slurmd.pid" "$work/slurmctld.pid" ${own_munge:+/run/munge/munged.pid}; do
        [ -s "$file" ] || continue
        pid="$(cat "$file")"
        kill "$pid" 2> /dev/null || true
        for _ in $(seq 50); do kill -0 "$pid" 2> /dev/null && sleep 0.2; done
    done
    rm -rf "$work"
}
trap stop EXIT

if ! munge -n > /dev/null 2>&1; then
    own_munge=yes
    runuser -u munge -- munged --force --pid-file /run/munge/munged.pid --socket /run/munge/munge.socket.2
fi
slurmctld
slurmd
for _ in $(seq 30); do
    [ "$(sinfo -h -o %T 2> /dev/null)" = idle ] && break
    sleep 1
done
[ "$(sinfo -h -o %T)" = idle ] || { sinfo -N -l; tail -n 20 "$work"/*.log; exit 1; }
sinfo

# A job of dask-jobqueue: one worker with one core.
cat > "$work/dask/jobqueue.yaml" << EOF
jobqueue:
  slurm:
    cores: 1
    processes: 1
    memory: 2GB
    walltime: '00:10:00'
    log-directory: $work
    local-directory: $work
    interface: lo
EOF
export DASK_CONFIG="$work/dask"
sweep=("$python" -m eidrive_scenario sweep coop/scenario_1 --vary channel.delay.seconds=0:0.4:0.1 --seeds 1-4)
"${sweep[@]}" --scheduler slurm --workers "$(nproc)" --store "$work/slurm.db"
"${sweep[@]}" --workers "$(nproc)" --store "$work/local.db"
squeue -h | grep . && { echo "jobs are left in the queue" >&2; exit 1; }
for store in slurm local; do
    "$python" -m eidrive_scenario results "$work/$store.db" --csv "$work/$store.csv" > /dev/null
done
"$python" - "$work" << 'EOF'
import sys
from pathlib import Path

import pandas

folder = Path(sys.argv[1])
rows = [pandas.read_csv(folder / f"{name}.csv").drop(columns=["seconds", "wall_s"]) for name in ("slurm", "local")]
rows = [table.sort_values(list(table.columns[:3])).reset_index(drop=True) for table in rows]
pandas.testing.assert_frame_equal(*rows)
assert len(rows[0]) == 20, len(rows[0])
print(f"{len(rows[0])} rows of SLURM equal those of local processes")
EOF
