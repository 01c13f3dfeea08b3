"""A local Dask cluster in a process of its own, which tests may kill."""

import json
import os
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass

CODE = """
import json, logging, sys
import dask
from distributed import LocalCluster, Nanny
def main():
    with dask.config.set(json.loads(sys.argv[2])), LocalCluster(
        n_workers=int(sys.argv[1]), threads_per_worker=1, dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
        memory_limit=sys.argv[3], silence_logs=logging.CRITICAL + 1,
    ) as cluster:
        print(json.dumps(cluster.scheduler_address), flush=True)
        sys.stdin.read()
if __name__ == "__main__":
    main()
"""
SETTINGS = {
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.scheduler.allowed-failures": 1,
}


@dataclass
class Cluster:
    """The address of a scheduler, and the process that it runs in."""

    address: str
    process: subprocess.Popen

    def kill(self):
        """End the scheduler as the kernel ends what takes too much memory."""
        self.process.kill()
        self.process.wait()


@contextmanager
def made_cluster(folder, workers, memory="1GB", preload=()):
    """Start a scheduler with workers here, which run `preload` first; all are gone at the end."""
    script = folder / "cluster.py"
    script.write_text(CODE)
    settings = json.dumps(SETTINGS | {"distributed.worker.preload": list(preload)})
    command = [sys.executable, script, str(workers), settings, memory]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    ) as process:
        try:
            yield Cluster(json.loads(process.stdout.readline()), process)
        finally:
            process.kill()
