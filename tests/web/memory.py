"""Peak memory of a browser, as the kernel states it: the memory of WebAssembly is not part of what a page can ask for."""

import os
import pathlib
import threading


def _processes():
    """Parents and command lines of all processes by their numbers."""
    found = {}
    for folder in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[1])
            command = (folder / "cmdline").read_bytes().decode(errors="replace")
        except OSError:
            continue
        found[int(folder.name)] = (parent, command)
    return found


def _descendants():
    processes = _processes()

    def is_own(pid):
        while pid in processes:
            pid = processes[pid][0]
            if pid == os.getpid():
                return True
        return False

    return {pid: command for pid, (_, command) in processes.items() if is_own(pid)}


def _peak(pid):
    """Largest resident memory [bytes]; none of a process that has ended."""
    try:
        lines = pathlib.Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM")), None)


class Peaks:
    """Largest resident memory of the processes that start within: `with Peaks() as peaks`, then `peaks.of("renderer")`.

    The processes are asked while they run, because one that ends takes its figure along.
    """

    def __enter__(self):
        self._before = set(_descendants())
        self._peaks, self._ended = {}, threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()
        self._look()

    def _watch(self):
        while not self._ended.wait(0.1):
            self._look()

    def _look(self):
        for pid, command in _descendants().items():
            peak = _peak(pid)
            if pid not in self._before and peak:
                kind = command.partition("--type=")[2].partition("\0")[0] or "browser"
                if "chrom" in command:
                    self._peaks[pid] = (kind.split(" ")[0], peak)

    def of(self, kind):
        """The largest process of a kind, `renderer` or `browser` [bytes]."""
        return max((peak for own, peak in self._peaks.values() if own == kind), default=0)

    def __str__(self):
        return f"peak of the renderer {self.of('renderer') / 1e6:.0f} MB, of the browser {self.of('browser') / 1e6:.0f} MB"
