"""A cluster of Slurm on this computer: its controller and nodes, each a slurmd, as processes of this user in a folder."""
import os
import pathlib
import secrets
import shutil
import signal
import socket
import subprocess
import time

from free_port import free_ports

NODES, CPUS = 4, 2
PATIENCE_S = 60.0
DAEMONS = ("munged", "slurmctld", "slurmd")

CONFIGURATION = """ClusterName=drivebench
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
CryptoType=crypto/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
KillWait=1
MessageTimeout=30
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
{nodes}
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def program(name):
    """A daemon, which a user has not in the path."""
    return shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")


def missing_daemons():
    return [name for name in DAEMONS if program(name) is None]


class SlurmCluster:
    """Ends its processes, and all that they have started, at the end of the context."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.configuration = self.folder / "slurm.conf"
        self.environment = {**os.environ, "SLURM_CONF": str(self.configuration)}
        self.daemons = {}

    def __enter__(self):
        host = socket.gethostname().split(".")[0]
        user = subprocess.run(["id", "-un"], capture_output=True, text=True, check=True).stdout.strip()
        (self.folder / "state").mkdir()
        (self.folder / "spool").mkdir()
        controller_port, *ports = free_ports(1 + NODES)
        nodes = "\n".join(f"NodeName=n{n} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs={CPUS} State=UNKNOWN"
                          for n, port in enumerate(ports, 1))
        self.configuration.write_text(CONFIGURATION.format(host=host, port=controller_port, user=user, folder=self.folder, nodes=nodes),
                                      encoding="utf-8")
        key = self.folder / "munge.key"
        key.write_bytes(secrets.token_bytes(1024))
        key.chmod(0o600)
        self.start("munged", "--foreground", "--force", f"--key-file={key}", f"--socket={self.folder}/munge.socket",
                   f"--pid-file={self.folder}/munged.pid", f"--log-file={self.folder}/munged.log",
                   f"--seed-file={self.folder}/munged.seed")
        self.wait_for(lambda: (self.folder / "munge.socket").exists(), "munged")
        self.start("slurmctld", "-D", "-f", self.configuration)
        for n in range(1, NODES + 1):
            self.start("slurmd", "-D", "-f", self.configuration, "-N", f"n{n}", name=f"n{n}")
        self.wait_for(lambda: self.ask("sinfo", "--noheader", "--format=%D %t") == f"{NODES} idle", "the nodes")
        return self

    def __exit__(self, *_):
        for pid in self.started_processes():
            self.kill(pid)
        for daemon in self.daemons.values():
            daemon.kill()
            daemon.wait()

    def start(self, daemon, *arguments, name=None):
        with (self.folder / f"{name or daemon}.out").open("wb") as out:
            self.daemons[name or daemon] = subprocess.Popen([program(daemon), *map(str, arguments)], stdout=out, stderr=out,
                                                            env=self.environment)

    def ask(self, *arguments):
        """What a program of Slurm prints; empty where it fails."""
        done = subprocess.run(arguments, capture_output=True, text=True, env=self.environment, timeout=PATIENCE_S, check=False)
        return done.stdout.strip() if done.returncode == 0 else ""

    def wait_for(self, condition, what):
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > deadline:
                logs = "\n".join(file.read_text(errors="replace")[-2000:] for file in self.folder.glob("*.log"))
                raise TimeoutError(f"no end of waiting for {what}\n{logs}\n{self.ask('sinfo', '--Node')}\n{self.ask('squeue', '--array')}")
            time.sleep(0.1)

    def tasks(self, job, state):
        """The numbers of the tasks of an array in a state."""
        return [int(task) for task in self.ask("squeue", "--noheader", "--array", f"--job={job}", f"--states={state}", "--format=%K").split()]

    def wait_for_end(self, job):
        """A task of a lost node may be completing for long, and Slurm would let two minutes pass before it starts it again."""
        def has_ended():
            waiting = self.tasks(job, "PENDING")
            for task in waiting:
                self.ask("scontrol", "update", f"JobId={job}_{task}", "StartTime=now")
            return not waiting and self.tasks(job, "RUNNING,CONFIGURING") == []

        self.wait_for(has_ended, f"job {job}")

    def started_processes(self, node=None):
        """Steps and jobs that slurmd started, which are not its children any more."""
        wanted = [f"SLURM_CONF={self.configuration}".encode()] + ([f"SLURMD_NODENAME={node}".encode()] if node else [])
        daemons = {daemon.pid for daemon in self.daemons.values()}
        for entry in pathlib.Path("/proc").iterdir():
            if not entry.name.isdigit() or int(entry.name) in daemons or int(entry.name) == os.getpid():
                continue
            try:
                variables = (entry / "environ").read_bytes().split(b"\0")
            except OSError:
                continue
            if all(each in variables for each in wanted):
                yield int(entry.name)

    @staticmethod
    def kill(pid):
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            pass

    def lose_node(self, name):
        """As if its power had gone: its slurmd and all of its tasks end without a word."""
        self.daemons[name].kill()
        for pid in self.started_processes(name):
            self.kill(pid)
        self.ask("scontrol", "update", f"NodeName={name}", "State=DOWN", "Reason=lost")
