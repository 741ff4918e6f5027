"""A Python module run as a process of its own, which ends with the process that started it, killed or not."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

# Its stdin closes when we are gone.
_FOLLOW = """
import os, runpy, sys, threading
def follow():
    sys.stdin.read()
    os._exit(0)
threading.Thread(target=follow, daemon=True).start()
module = sys.argv.pop()
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""


def started(module: str) -> subprocess.Popen[str]:
    """Start a module of a package; what it prints can be read from the process's ``stdout``."""
    package = find_spec(module.partition(".")[0])
    path = [] if package is None or package.origin is None else [str(Path(package.origin).parents[1])]
    # A session of its own keeps Ctrl-C from it; what it has to say besides nobody reads.
    process = subprocess.Popen(
        [sys.executable, "-u", "-P", "-W", "ignore", "-c", _FOLLOW, module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path)},
        start_new_session=True,
        text=True,
    )
    atexit.register(end, process)
    return process


def end(process: subprocess.Popen[str]) -> None:
    """End a helper and wait until it is gone."""
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            stream.close()
