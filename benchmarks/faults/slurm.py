"""examples/slurm.sh on a real Slurm of one node: preempted, requeued, stopped, and the same bytes.

    python -m benchmarks.faults.slurm [--quick] [--markdown] [--mpi pmi2|pmix] [--rounds R]

Needs Slurm and munge: on Debian `apt-get install slurm-wlm munge`. Neither has to run, nor to be
set up: this starts daemons of its own, as the user who calls it, in a temporary folder, on ports of
their own, and ends them. ``--mpi``: how srun and the MPI of this Python find each other, pmi2 for
MPICH and Intel MPI, pmix for Open MPI. Jobs are hit when the journal has begun to grow: requeued
(`scontrol requeue`), warned as before their time limit (SIGUSR1 to the step: the script asks to be
run again), preempted by a job of a better partition, or their step is killed.
"""

import contextlib
import getpass
import os
import random
import re
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import attrs

from benchmarks.reporting import Table, begin
from tests.helpers.jobs import BESIDE_PYTHON, STUDY, run_here
from tests.helpers.results_files import same_data

ROOT = Path(__file__).resolve().parents[2]
REPLICATES = 4000
"""Of ten conditions: long enough to be hit while it runs."""

PATIENCE = 300.0
"""Seconds in which something has to happen."""

SETTINGS = """\
ClusterName=flocsim
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=5
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort={port}
SlurmdPort={port_of_node}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
MpiDefault={mpi}
ReturnToService=2
KillWait=10
SchedulerParameters=batch_sched_delay=0,sched_interval=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} State=UNKNOWN
PartitionName=usual Nodes={host} Default=YES PriorityTier=1 State=UP
PartitionName=urgent Nodes={host} PriorityTier=2 State=UP
"""


def free_port():
    """A port that nobody listens on."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@contextlib.contextmanager
def cluster(folder, mpi):
    """The environment of a Slurm of one node, which runs meanwhile."""
    for name in ("munged", "slurmctld", "slurmd"):
        if not shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin"):
            raise SystemExit(f"there is no {name}: apt-get install slurm-wlm munge")
    for name in ("state", "spool"):
        (folder / name).mkdir()
    folder.chmod(0o755)
    key = folder / "munge.key"
    key.write_bytes(secrets.token_bytes(1024))
    key.chmod(0o600)
    host = socket.gethostname().partition(".")[0]
    settings = SETTINGS.format(
        host=host, user=getpass.getuser(), folder=folder, mpi=mpi, cpus=os.cpu_count(),
        port=free_port(), port_of_node=free_port(),
    )  # fmt: skip
    (folder / "slurm.conf").write_text(settings)
    env = os.environ | {
        "SLURM_CONF": str(folder / "slurm.conf"),
        "PATH": f"{BESIDE_PYTHON}:{os.environ['PATH']}:/usr/sbin",
        "PYTHONPATH": f"{ROOT}:{os.environ.get('PYTHONPATH', '')}",
    }
    munge = [
        "munged", "--force", f"--key-file={key}", f"--socket={folder}/munge.socket",
        f"--pid-file={folder}/munged.pid", f"--log-file={folder}/munged.log",
        f"--seed-file={folder}/munged.seed",
    ]  # fmt: skip
    try:
        for words in (munge, ["slurmctld"], ["slurmd"]):
            subprocess.run(words, env=env, check=True)
        wait_until(lambda: "idle" in told(env, "sinfo", "-h", "-o", "%T"), "an idle node")
        yield env
    finally:
        for name in ("slurmd", "slurmctld", "munged"):
            with contextlib.suppress(OSError, ValueError):
                os.kill(int((folder / f"{name}.pid").read_text()), signal.SIGTERM)


def told(env, *words):
    """What a command of Slurm prints."""
    return subprocess.run(words, env=env, capture_output=True, text=True).stdout


def wait_until(is_so, what):
    until = time.monotonic() + PATIENCE
    while not is_so():
        if time.monotonic() > until:
            raise TimeoutError(f"waited for {what}")
        time.sleep(0.1)


@attrs.frozen
class Submitted:
    """A job that runs examples/slurm.sh in a folder."""

    folder: Path
    env: dict
    number: str

    @classmethod
    def begin(cls, folder, env):
        words = ["sbatch", "--parsable", "--nodes=1", "--ntasks-per-node=2", "--time=10",
                 "--output=log.txt", str(ROOT / "examples" / "slurm.sh"), "study.toml"]  # fmt: skip
        done = subprocess.run(
            words, cwd=folder, env=env, capture_output=True, text=True, check=True
        )
        return cls(folder, env, done.stdout.strip())

    def fact(self, name):
        """One of the facts that Slurm tells of a job."""
        text = told(self.env, "scontrol", "show", "job", self.number)
        return next(iter(re.findall(rf"\b{name}=(\S+)", text)), "")

    @property
    def rows(self):
        """Bytes of the journal."""
        path = self.folder / "study.h5.journal"
        return path.stat().st_size if path.exists() else 0

    @property
    def has_ended(self):
        return self.fact("JobState") in ("COMPLETED", "FAILED", "TIMEOUT", "CANCELLED", "NODE_FAIL")

    def hit(self, way):
        """Stop the job in a way in which it is run again."""
        if way == "preempted":
            words = ["sbatch", "--partition=urgent", "--exclusive", "--output=/dev/null",
                     "--wrap=sleep 1"]  # fmt: skip
        elif way == "requeued":
            words = ["scontrol", "requeue", self.number]
        else:
            sign = "USR1" if way == "warned" else "KILL"
            words = ["scancel", f"--signal={sign}", f"{self.number}.0"]
        subprocess.run(words, env=self.env, check=True, cwd=self.folder, stdout=subprocess.DEVNULL)


@attrs.define
class Tally:
    """How faults of one kind have ended."""

    faults: int = 0
    right: int = 0
    hangs: int = 0
    slowest: float = 0.0
    wrong: list = attrs.Factory(list)

    def add(self, problem, seconds, hang=False):
        """Count a fault; ``problem`` is "" where nothing was lost."""
        self.faults += 1
        self.right += not problem
        self.hangs += hang
        self.slowest = max(self.slowest, seconds)
        if problem:
            self.wrong.append(problem)
            print(problem, file=sys.stderr, flush=True)


WAYS = ("requeued", "warned", "preempted", "step killed")


def run_once(folder, env, way, rng, reference):
    """What is wrong with a job that was stopped once, and run again; or ""."""
    folder.mkdir()
    (folder / "study.toml").write_text(
        STUDY.replace("replicates = 200", f"replicates = {REPLICATES}")
    )
    job = Submitted.begin(folder, env)
    wait_until(lambda: job.rows > 20_000 or job.has_ended, "rows")
    time.sleep(rng.uniform(0.0, 1.0))
    job.hit(way)
    if way == "step killed":
        wait_until(lambda: job.has_ended, "the end of a job whose step was killed")
        if job.fact("JobState") == "COMPLETED":
            return "the job was reported as completed"
        job = Submitted.begin(folder, env)
    else:
        wait_until(lambda: job.fact("Restarts") == "1" or job.has_ended, "the requeue")
        if job.fact("Restarts") != "1":
            return f"not run again: {(folder / 'log.txt').read_text()}"
    wait_until(lambda: job.has_ended, "the end")
    if job.fact("JobState") != "COMPLETED":
        return f"{job.fact('JobState')}, {job.fact('ExitCode')}: {(folder / 'log.txt').read_text()}"
    log = (folder / "log.txt").read_text()
    if "on 2 ranks" not in log:
        return f"not two ranks: {log}"
    apart = same_data(reference, folder / "study.h5")
    return f"bytes differ: {apart}" if apart else ""


def main():
    """Print the table; exit code 1 if anything was lost."""
    mpi = {"default": "pmi2", "choices": ["pmi2", "pmix"], "help": "default: %(default)s"}
    arguments = begin(__doc__, packages=("h5py", "mpi4py", "mpich"), mpi=mpi, rounds=5)
    rng = random.Random()
    tallies = {way: Tally() for way in WAYS}
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        (root / "reference").mkdir()
        text = STUDY.replace("replicates = 200", f"replicates = {REPLICATES}")
        (root / "reference" / "study.toml").write_text(text)
        reference = run_here(root / "reference")
        (root / "slurm").mkdir()
        with cluster(root / "slurm", arguments.mpi) as env:
            for number in range(1 if arguments.quick else arguments.rounds):
                for way in WAYS:
                    began = time.monotonic()
                    folder = root / f"{way.replace(' ', '-')}{number}"
                    try:
                        problem = run_once(folder, env, way, rng, reference)
                    except TimeoutError as error:
                        problem = str(error)
                    tallies[way].add(problem and f"{way}: {problem}", time.monotonic() - began,
                                     problem.startswith("waited"))  # fmt: skip
    table = Table("Jobs of Slurm", ("stopped by", "jobs", "same bytes", "hangs", "longest [s]"))
    for way, tally in tallies.items():
        table.add(way, tally.faults, tally.right, tally.hangs, tally.slowest)
    table.print()
    return 1 if any(tally.wrong for tally in tallies.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
