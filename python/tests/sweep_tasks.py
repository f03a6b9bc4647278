"""Functions of the tests of sweeps, in a module that workers can import."""

import os
import signal
import time
from pathlib import Path


def square(x, seed=0):
    return f"{x * x} {seed}".encode(), {"square": x * x}


def noted(x, folder):
    """Leaves a mark for each start and waits, so that a test can end the process in the middle."""
    Path(folder, f"{x}-{os.getpid()}-{time.time_ns()}").touch()
    time.sleep(0.1)
    return str(x).encode(), {"x": x, "pid": os.getpid()}


def fails(x):
    raise ValueError(f"the value {x} cannot be used")


def fails_once(x, folder):
    mark = Path(folder, str(x))
    if not mark.exists():
        mark.touch()
        raise OSError("at the first start")
    return None, {"x": x}


def ends_its_process(x, folder, always):
    """Ends its own process at the first start, or at every one."""
    mark = Path(folder, f"ended-{x}")
    if x == 3 and (always or not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return str(x).encode(), {"x": x}


def no_record():
    return None, {"value": object()}
