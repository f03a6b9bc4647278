"""Sweeps: many independent tasks on joblib, Ray, Dask or Slurm, with results that survive an interruption.

A task is a pure function with its arguments. Its fingerprint names its files, so that a task has one result however
often it is started: by a retry, by a second driver, or by the same sweep after an interruption.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import itertools
import json
import os
import socket
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Union

import numpy as np

from . import _hydroid
from ._control import control
from ._hydroid import Log, Model
from ._identify import identify
from ._options import Bar

#: ``function(**arguments) -> (bytes or None, record)``
Function = Callable[..., tuple[Union[bytes, None], Mapping[str, Any]]]


def fit(
    logs: Any,
    config: Mapping[str, Mapping[str, Any]] | None = None,
    seed: int = 0,
    *,
    methods: str | Sequence[str] = "sindy",
    validate: Any = (),
    test: Any = (),
    vessel: Any = None,
) -> tuple[bytes, dict[str, Any]]:
    """Identify the best model of a vessel on one thread: the task of a sweep over identifications.

    Parameters
    ----------
    logs, validate, test : Log, path, data frame, mapping, or list of these
    config : mapping, optional
        Sections of ``hydroid.toml``: ``{"log": {"outputs": ["u", "v", "r"]}, "identify": {"horizon": "10s"},
        "sindy": {"degree": 2}}``.
    seed : int
    methods, vessel
        As in `identify`.

    Returns
    -------
    bytes
        The file of the best model.
    record : dict
        ``model``, ``kind``, ``size``, ``score`` (mean NRMSE over outputs and horizons, judged on the test logs, else in
        the cross-validation), and for each output at the longest horizon ``nrmse_u``, ``rmse_u``, ``persistence_nrmse_u``
        and ``grade_u``.

    Raises
    ------
    ValueError
        If no model was found.
    """
    found = identify(
        logs, validate=validate, test=test, methods=methods, seed=seed, sections=config, vessel=vessel, threads=1
    )
    best = found.best
    if best is None:
        reasons = "; ".join(warning["message"] for warning in found.warnings)
        raise ValueError(f"no model was found: {reasons or 'every model diverged'}")
    judged = found.judgement[best.name].judged
    record: dict[str, Any] = {
        "model": best.name,
        "kind": best.kind,
        "size": best.size,
        "horizon_s": float(judged.horizons[-1] * judged.dt),
        "windows": judged.windows,
        "score": judged.score,
    }
    grades = {verdict["channel"]: verdict["grade"] for verdict in found.verdicts}
    for c, output in enumerate(judged.outputs):
        record[f"nrmse_{output}"] = float(judged.nrmse[-1, c])
        record[f"rmse_{output}"] = float(judged.rmse[-1, c])
        record[f"persistence_nrmse_{output}"] = float(judged.persistence["nrmse"][-1, c])
        record[f"grade_{output}"] = grades.get(output)
    record["warnings"] = len(found.warnings)
    return best.to_bytes(), record


def closed_loop(
    plant: Any,
    model: Any = None,
    options: Mapping[str, Any] | None = None,
    seed: int = 0,
) -> tuple[None, dict[str, Any]]:
    """Simulate a closed loop on one thread: the task of a Monte Carlo sweep over conditions and controllers.

    Parameters
    ----------
    plant, model : Model, path or name
        As in `control`.
    options : mapping, optional
        Further options of `control`.
    seed : int

    Returns
    -------
    None
        There is no file.
    record : dict
        The metrics of the run besides computing times: ``rms_position`` [m], ``rms_cross_track`` [m], ``rms_speed`` [m/s],
        ``max_cross_track`` [m], ``settled_after`` [s], ``saturated``, ``held``, ``diverged``, ``violations`` and others.
    """
    metrics = control(plant, model, seed=seed, threads=1, **(options or {})).metrics
    return None, {name: value for name, value in metrics.items() if not isinstance(value, Mapping)}


@dataclass(frozen=True)
class Task:
    """A pure function and its arguments.

    Parameters
    ----------
    function : callable
        A function of a module that the workers can import. It returns the bytes of a file, or None, and a record: a
        mapping from names to numbers, texts or None.
    arguments : mapping
        Keyword arguments: numbers, texts, lists, mappings, arrays, `Log`, `Model`. A `pathlib.Path` is a file, whose
        content is part of the fingerprint; a text is only a text.
    labels : mapping
        Further columns of the record.
    version : str
        A part of the fingerprint, to be changed with the function. The version of hydroid is another part.
    suffix : str
        Ending of the file with the bytes.
    """

    function: Function
    arguments: Mapping[str, Any]
    labels: Mapping[str, Any] = field(default_factory=dict)
    version: str = ""
    suffix: str = ".safetensors"

    @property
    def fingerprint(self) -> str:
        """SHA-256 of function, arguments, labels and versions, 32 hexadecimal digits."""
        name = f"{self.function.__module__}:{self.function.__qualname__}"
        key = [name, self.version, _hydroid.__version__, _canonical(self.arguments), _canonical(self.labels)]
        return hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:32]


def _canonical(value: Any) -> Any:
    """A value as JSON that identifies it."""
    if isinstance(value, Mapping):
        return {str(name): _canonical(item) for name, item in value.items()}
    if isinstance(value, (list, tuple, range)):
        return [_canonical(item) for item in value]
    if isinstance(value, Path):
        return ["file", _file_hash(str(value), _stamp(value))]
    if isinstance(value, Log):
        digest = hashlib.sha256()
        for name in value.columns:
            digest.update(f"{name} [{value.units[name]}]".encode())
            digest.update(value[name].tobytes())
        return ["log", digest.hexdigest()]
    if isinstance(value, Model):
        return ["model", hashlib.sha256(value.to_bytes()).hexdigest()]
    if isinstance(value, np.ndarray):
        digest = hashlib.sha256(f"{value.dtype} {value.shape}".encode() + value.tobytes())
        return ["array", digest.hexdigest()]
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(
        f"arguments: expected numbers, texts, lists, mappings, arrays, paths, Log or Model, got {type(value).__name__}"
    )


_hashes: dict[tuple[str, tuple[int, int]], str] = {}


def _stamp(path: Path) -> tuple[int, int]:
    about = path.stat()
    return about.st_size, about.st_mtime_ns


def _file_hash(path: str, stamp: tuple[int, int]) -> str:
    """Hash of a file, read once for all tasks."""
    if (path, stamp) not in _hashes:
        digest = hashlib.sha256()
        with open(path, "rb") as file:
            while part := file.read(1 << 20):
                digest.update(part)
        _hashes[path, stamp] = digest.hexdigest()
    return _hashes[path, stamp]


def _placed(arguments: Mapping[str, Any], key: str, value: Any) -> dict[str, Any]:
    """A copy of nested mappings with the value at a dotted key."""
    head, _, rest = key.partition(".")
    copy = dict(arguments)
    if rest and not isinstance(copy.get(head) or {}, Mapping):
        raise ValueError(f"axes: expected a mapping at '{head}' of the argument, got {copy[head]!r}")
    copy[head] = _placed(copy.get(head) or {}, rest, value) if rest else value
    return copy


def grid(
    function: Function,
    arguments: Mapping[str, Any],
    axes: Mapping[str, Iterable[Any]],
    **options: Any,
) -> list[Task]:
    """Tasks for all combinations of values.

    Parameters
    ----------
    function : callable
        `fit`, `closed_loop`, or any function for `Task`.
    arguments : mapping
        The common arguments.
    axes : mapping
        Values by argument; a dot leads into a mapping: ``{"config.sindy.degree": [1, 2], "seed": range(5)}``. The
        values are labels of the tasks.
    **options
        Further fields of `Task`.
    """
    for key, values in axes.items():
        if isinstance(values, str) or not isinstance(values, Iterable):
            raise TypeError(f"axes: expected a list of values at {key!r}, got {values!r}")
    combinations = itertools.product(*([(key, value) for value in values] for key, values in axes.items()))
    return [_varied(function, arguments, combination, options) for combination in combinations]


def random_search(
    function: Function,
    arguments: Mapping[str, Any],
    axes: Mapping[str, Callable[[np.random.Generator], Any]],
    n: int,
    *,
    seed: int = 0,
    **options: Any,
) -> list[Task]:
    """Tasks with random values.

    Parameters
    ----------
    function, arguments, **options
        As in `grid`.
    axes : mapping
        Functions of a NumPy generator by argument: ``{"config.sindy.threshold": lambda rng: 10 ** rng.uniform(-3, 0)}``.
    n : int
        Number of tasks. The first tasks of a longer search with the same seed are the same.
    seed : int
    """
    generators = (np.random.default_rng([seed, i]) for i in range(n))
    drawn = ([(key, draw(rng)) for key, draw in axes.items()] for rng in generators)
    return [_varied(function, arguments, values, options) for values in drawn]


def _varied(
    function: Function,
    arguments: Mapping[str, Any],
    values: Sequence[tuple[str, Any]],
    options: Mapping[str, Any],
) -> Task:
    labels = dict(options.get("labels", {}))
    varied: dict[str, Any] = dict(arguments)
    parameters = inspect.signature(function).parameters.values()
    if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        names = [parameter.name for parameter in parameters]
        for name in (*arguments, *(key.partition(".")[0] for key, _ in values)):
            if name not in names:
                raise ValueError(
                    f"arguments and axes: expected arguments of {function.__qualname__} ({', '.join(names)}), got {name!r}"
                )
    for key, value in values:
        varied = _placed(varied, key, value)
        scalar = value.item() if isinstance(value, np.generic) else value
        labels[key] = scalar if isinstance(scalar, (bool, int, float, str)) else json.dumps(_canonical(scalar))
    return Task(function, varied, **{**options, "labels": labels})


def fleet(table: Any, arguments: Mapping[str, Any] | None = None, *, function: Function = fit) -> list[Task]:
    """One task for each vessel of a fleet.

    Parameters
    ----------
    table : data frame or iterable of mappings
        Rows with the columns ``vessel`` and ``log`` (a path), and optionally ``role``: ``train`` (the default),
        ``validate`` or ``test``.
    arguments : mapping, optional
        Further arguments of `fit`, common to all vessels.
    function : callable
        `fit`, or a function with its arguments.
    """
    if hasattr(table, "to_dicts"):
        rows = table.to_dicts()
    elif hasattr(table, "to_pylist"):
        rows = table.to_pylist()
    elif hasattr(table, "to_dict"):
        rows = table.to_dict("records")
    else:
        rows = list(table)
    vessels: dict[str, dict[str, list[Any]]] = {}
    roles = {"train": "logs", "validate": "validate", "test": "test"}
    for i, row in enumerate(rows):
        missing = {"vessel", "log"} - set(row)
        if missing:
            raise ValueError(f"table: expected the columns vessel and log, got {', '.join(map(str, row))}")
        role = row.get("role") or "train"
        if role not in roles:
            raise ValueError(f"table: expected the roles train, validate or test, got {role!r} in row {i}")
        log = row["log"]
        vessel = vessels.setdefault(str(row["vessel"]), {})
        vessel.setdefault(roles[role], []).append(log if isinstance(log, Log) else Path(log))
    without = [name for name, logs in vessels.items() if "logs" not in logs]
    if without:
        raise ValueError(f"table: expected a log of the role train for each vessel, got none for {', '.join(without)}")
    return [
        Task(function, {**(arguments or {}), **logs}, labels={"vessel": name}) for name, logs in vessels.items()
    ]


@dataclass(frozen=True)
class _Store:
    """Files of a sweep under fsspec."""

    url: str
    options: Mapping[str, Any]

    def open(self) -> tuple[Any, str]:
        try:
            import fsspec
        except ImportError as error:
            raise ImportError("a sweep needs fsspec and pyarrow: pip install 'hydroid[sweeps]'") from error
        filesystem, path = fsspec.core.url_to_fs(self.url, **self.options)
        return filesystem, path.rstrip("/")

    def write(self, name: str, content: bytes) -> None:
        """Write a file completely or not at all. Object stores do so themselves."""
        filesystem, folder = self.open()
        path = f"{folder}/{name}"
        if "file" not in np.atleast_1d(filesystem.protocol):
            filesystem.pipe_file(path, content)
            return
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        descriptor, part = tempfile.mkstemp(prefix=f"{_part()}{os.getpid()}-", dir=os.path.dirname(path))
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(part, 0o644)
            os.replace(part, path)
        except BaseException:
            Path(part).unlink(missing_ok=True)
            raise

    def clean(self) -> None:
        """Remove what ended processes of this machine left half written."""
        filesystem, folder = self.open()
        if "file" not in np.atleast_1d(filesystem.protocol):
            return
        for part in Path(folder).glob(f"*/{_part()}*"):
            try:
                os.kill(int(part.name[len(_part()) :].partition("-")[0]), 0)
            except (ProcessLookupError, ValueError):
                part.unlink(missing_ok=True)
            except OSError:
                pass

    def exists(self, name: str) -> bool:
        filesystem, folder = self.open()
        return bool(filesystem.exists(f"{folder}/{name}"))

    def records(self, known: Iterable[str] | None = None) -> dict[str, dict[str, Any]]:
        """The records by fingerprint."""
        filesystem, folder = self.open()
        filesystem.invalidate_cache()
        try:
            names = filesystem.ls(f"{folder}/{_RECORDS}", detail=False)
        except FileNotFoundError:
            return {}
        paths = {os.path.basename(name)[:-5]: name for name in names if name.endswith(".json")}
        wanted = sorted(paths if known is None else set(known) & set(paths))
        found = {}
        for start in range(0, len(wanted), 1000):
            part = wanted[start : start + 1000]
            contents = filesystem.cat([paths[fingerprint] for fingerprint in part])
            for fingerprint in part:
                found[fingerprint] = json.loads(contents[paths[fingerprint]])
        return found


def _part() -> str:
    """Start of the names of files that a process of this machine is writing."""
    return f".part-{socket.gethostname()}-"


_RECORDS = "records"
_FILES = "files"


class _Item(NamedTuple):
    fingerprint: str
    task: Task
    attempt: int


class Lost(NamedTuple):
    """The process of a task ended before the task."""

    error: str


#: None if the result is stored, the error of the task, or what is known of its process.
Outcome = Union[None, str, Lost]


class _Call(NamedTuple):
    """What a worker does: one task, whose result it stores."""

    store: _Store

    def __call__(self, item: _Item) -> tuple[str, Outcome]:
        fingerprint, task, attempt = item
        if self.store.exists(f"{_RECORDS}/{fingerprint}.json"):
            return fingerprint, None
        started = time.perf_counter()
        try:
            content, result = task.function(**task.arguments)
            _json(result)
        except Exception as error:
            lines = traceback.format_exception(error)
            return fingerprint, f"{type(error).__name__}: {error}\n{''.join(lines[-8:])}"
        record: dict[str, Any] = {**result, "fingerprint": fingerprint, **task.labels}
        if content is not None:
            record["file"] = f"{_FILES}/{fingerprint}{task.suffix}"
            record["sha256"] = hashlib.sha256(content).hexdigest()
            self.store.write(record["file"], content)
        record.update(_circumstances("done", None, attempt, time.perf_counter() - started))
        # The record comes last: a task with a record is complete.
        self.store.write(f"{_RECORDS}/{fingerprint}.json", _json(record))
        return fingerprint, None


def _circumstances(status: str, error: str | None, attempts: int, seconds: float) -> dict[str, Any]:
    """The part of a record that may differ between two runs of a task."""
    about = {"status": status, "error": error, "attempts": attempts, "seconds": seconds, "host": socket.gethostname()}
    try:
        import resource
    except ImportError:
        return about
    # Kilobytes on Linux, bytes on macOS.
    unit = 1024.0**2 if sys.platform == "darwin" else 1024.0
    return {**about, "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit}


def _json(record: Mapping[str, Any]) -> bytes:
    def plain(value: Any) -> Any:
        if isinstance(value, np.generic):
            return value.item()
        raise TypeError(f"record: expected numbers, texts or None, got {type(value).__name__}")

    return (json.dumps(record, indent=1, default=plain) + "\n").encode()


class Backend(Protocol):
    """Where tasks run."""

    #: Whether a lost process names its task. Otherwise the tasks under way are started again one at a time.
    exact: bool

    def run(self, call: Any, items: Iterator[Any]) -> Iterator[tuple[Any, Outcome]]:
        """Call a function for each item, in any order; yields items with their outcomes."""


class _Serial:
    exact = True

    def run(self, call: Any, items: Iterator[Any]) -> Iterator[tuple[Any, Outcome]]:
        for item in items:
            yield item, call(item)[1]


class _Joblib:
    exact = False

    def __init__(self, workers: int | None) -> None:
        self.workers = workers or os.cpu_count() or 1

    def run(self, call: Any, items: Iterator[Any]) -> Iterator[tuple[Any, Outcome]]:
        from joblib import Parallel, delayed
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        under_way: dict[str, Any] = {}

        def drawn() -> Iterator[Any]:
            for item in items:
                under_way[item.fingerprint] = item
                yield delayed(call)(item)

        # A pool of processes even for one worker: a task may end its process.
        workers = max(self.workers, 2)
        parallel = Parallel(
            n_jobs=workers, backend="loky", return_as="generator_unordered", batch_size=1, pre_dispatch=self.workers
        )
        try:
            for fingerprint, outcome in parallel(drawn()):
                yield under_way.pop(fingerprint), outcome
        except TerminatedWorkerError as error:
            for item in list(under_way.values()):
                yield item, Lost(str(error))


class _Ray:
    exact = True

    def __init__(self, workers: int | None) -> None:
        self.workers = workers

    def run(self, call: Any, items: Iterator[Any]) -> Iterator[tuple[Any, Outcome]]:
        import ray

        own = not ray.is_initialized()
        if own:
            ray.init(num_cpus=self.workers, include_dashboard=False, log_to_driver=False)
        under_way: dict[Any, Any] = {}
        try:
            start = ray.remote(max_retries=0, num_cpus=1)(_called)
            shared = ray.put(call)
            # Enough for all workers to have a next task.
            limit = 2 * int(ray.cluster_resources().get("CPU", 1))
            while True:
                for item in itertools.islice(items, limit - len(under_way)):
                    under_way[start.remote(shared, item)] = item
                if not under_way:
                    break
                for done in ray.wait(list(under_way), num_returns=1)[0]:
                    item = under_way.pop(done)
                    try:
                        yield item, ray.get(done)[1]
                    except ray.exceptions.RayTaskError as error:
                        yield item, str(error)
                    except ray.exceptions.RayError as error:
                        yield item, Lost(f"{type(error).__name__}: {error}")
        finally:
            for left in under_way:
                ray.cancel(left, force=True)
            if own:
                ray.shutdown()


def _called(call: Any, item: Any) -> Any:
    return call(item)


class _Dask:
    exact = True

    def __init__(self, client: Any, workers: int | None) -> None:
        self.client = client
        self.workers = workers

    def run(self, call: Any, items: Iterator[Any]) -> Iterator[tuple[Any, Outcome]]:
        from distributed import Client, KilledWorker, LocalCluster, as_completed

        cluster = None
        client = self.client
        if client is None:
            cluster = LocalCluster(
                n_workers=self.workers or os.cpu_count() or 1,
                threads_per_worker=1,
                processes=True,
                dashboard_address=None,
            )
            client = Client(cluster)
        try:
            limit = 2 * max(sum(client.nthreads().values()), 1)
            under_way = {}

            def start(item: Any) -> Any:
                future = client.submit(call, item, pure=False)
                under_way[future.key] = item
                return future

            queue = as_completed([start(item) for item in itertools.islice(items, limit)])
            for done in queue:
                item = under_way.pop(done.key)
                error = done.exception()
                if error is None:
                    yield item, done.result()[1]
                elif isinstance(error, KilledWorker):
                    yield item, Lost(f"KilledWorker: {error}")
                else:
                    yield item, f"{type(error).__name__}: {error}"
                for item in itertools.islice(items, 1):
                    queue.add(start(item))
        finally:
            if cluster is not None:
                client.close()
                cluster.close()


class _Submitit:
    """Jobs of Slurm, or processes of this machine where there is no Slurm."""

    exact = True

    def __init__(self, executor: Any, workers: int | None, folder: str) -> None:
        if executor is None:
            import submitit

            executor = submitit.AutoExecutor(folder=folder)
            executor.update_parameters(timeout_min=24 * 60, cpus_per_task=1)
        self.executor = executor
        self.limit = workers or (os.cpu_count() or 1)

    def run(self, call: Any, items: Iterator[Any]) -> Iterator[tuple[Any, Outcome]]:
        under_way: list[tuple[Any, Any]] = []
        while True:
            for item in itertools.islice(items, self.limit - len(under_way)):
                under_way.append((self.executor.submit(call, item), item))
            if not under_way:
                return
            ended = [pair for pair in under_way if pair[0].done()]
            if not ended:
                time.sleep(0.2)
            for pair in ended:
                under_way.remove(pair)
                job, item = pair
                error = job.exception()
                yield item, job.result()[1] if error is None else Lost(f"{type(error).__name__}: {error}")


def _backend(given: Any, workers: int | None, folder: str) -> Backend:
    names = ("serial", "joblib", "ray", "dask", "submitit")
    if isinstance(given, str):
        if given not in names:
            raise ValueError(f"backend: expected one of {', '.join(names)}, got {given!r}")
        makers: dict[str, Callable[[], Backend]] = {
            "serial": _Serial,
            "joblib": lambda: _Joblib(workers),
            "ray": lambda: _Ray(workers),
            "dask": lambda: _Dask(None, workers),
            "submitit": lambda: _Submitit(None, workers, folder),
        }
        package = {"dask": "distributed"}.get(given, given)
        if given != "serial" and importlib.util.find_spec(package) is None:
            raise ImportError(f"backend={given!r} needs the package {package}: pip install {package}")
        return makers[given]()
    module = type(given).__module__.partition(".")[0]
    if module == "distributed":
        return _Dask(given, workers)
    if module == "submitit":
        return _Submitit(given, workers, folder)
    if hasattr(given, "run") and hasattr(given, "exact"):
        own: Backend = given
        return own
    raise TypeError(
        f"backend: expected one of {', '.join(names)}, a client of Dask or an executor of submitit, "
        f"got {type(given).__name__}"
    )


class Sweep:
    """Results of a sweep.

    Attributes
    ----------
    folder : str
    records : list of dict
        One for each task, in the order of the tasks: ``fingerprint``, ``status`` (``done`` or ``failed``), ``error``,
        ``attempts``, ``seconds``, ``peak_memory_mb`` of the process, ``host``, ``file``, ``sha256``, the labels of the
        task and its record.
    """

    def __init__(self, store: _Store, records: list[dict[str, Any]]) -> None:
        self._store = store
        self.folder = store.url
        self.records = records

    @property
    def failed(self) -> list[dict[str, Any]]:
        """Records of the tasks that failed."""
        return [record for record in self.records if record["status"] != "done"]

    def read(self, record: Union[str, Mapping[str, Any]]) -> bytes:
        """The file of a task, by its record or fingerprint."""
        if isinstance(record, str):
            found = [item for item in self.records if item["fingerprint"] == record]
            if not found:
                raise KeyError(record)
            record = found[0]
        if not record.get("file"):
            raise ValueError(f"record: expected a task with a file, got {record['fingerprint']} ({record['status']})")
        filesystem, folder = self._store.open()
        content: bytes = filesystem.cat_file(f"{folder}/{record['file']}")
        return content

    def model(self, record: Union[str, Mapping[str, Any]]) -> Model:
        """The model of a task, by its record or fingerprint."""
        return Model.from_bytes(self.read(record))

    def best(self) -> dict[str, Any]:
        """The record with the least finite ``score``."""
        scored = [item for item in self.records if np.isfinite(item.get("score") or np.nan)]
        if not scored:
            raise ValueError("no task has a finite score")
        return min(scored, key=lambda item: float(item["score"]))

    def to_pandas(self) -> Any:
        """The records as a pandas data frame."""
        import pandas

        return pandas.DataFrame(self.records)

    def __repr__(self) -> str:
        failed = self.failed
        reason = f"; the first: {failed[0]['error'].splitlines()[0]}" if failed else ""
        return f"Sweep({self.folder!r}: {len(self.records) - len(failed)} tasks done, {len(failed)} failed{reason})"


def sweep(
    tasks: Iterable[Task],
    folder: str | os.PathLike[str],
    *,
    backend: Any = "joblib",
    workers: int | None = None,
    retries: int = 2,
    rerun_failed: bool = False,
    storage_options: Mapping[str, Any] | None = None,
    progress: bool | Callable[[float], object] = False,
) -> Sweep:
    """Run tasks, and gather their records in ``results.parquet``.

    Tasks that have a record in the folder are not run again, so that an interrupted sweep goes on where it was. Equal
    tasks run once.

    Parameters
    ----------
    tasks : iterable of Task
    folder : path or URL of fsspec
        ``records/FINGERPRINT.json`` and ``files/FINGERPRINT.safetensors`` for each task, and ``results.parquet``.
        Workers on other machines must reach it.
    backend : str or object
        ``"serial"``, ``"joblib"``, ``"ray"`` (the cluster of `ray.init`, else one of this machine), ``"dask"``,
        ``"submitit"``, a client of Dask, or an executor of submitit with the parameters of a Slurm cluster.
    workers : int, optional
        Processes on this machine; with submitit, the largest number of jobs at a time. Default: all cores.
    retries : int
        Further attempts after an error or the end of a process; then the error is recorded.
    rerun_failed : bool
        Whether tasks whose failure is recorded are run again.
    storage_options : mapping, optional
        Options of the file system.
    progress : bool or callable
        A bar of tqdm, or a function of the completed fraction.

    Returns
    -------
    Sweep
    """
    if retries < 0:
        raise ValueError(f"retries: expected a number from 0 on, got {retries}")
    url = os.fspath(folder)
    store = _Store(url if "://" in url else os.path.abspath(url), dict(storage_options or {}))
    wanted: dict[str, Task] = {}
    for task in tasks:
        if not isinstance(task, Task):
            raise TypeError(f"tasks: expected hydroid.Task objects, got {type(task).__name__}")
        wanted.setdefault(task.fingerprint, task)
    records = store.records(wanted)
    if rerun_failed:
        again = [fingerprint for fingerprint, record in records.items() if record["status"] != "done"]
        filesystem, path = store.open()
        for fingerprint in again:
            filesystem.rm_file(f"{path}/{_RECORDS}/{fingerprint}.json")
            del records[fingerprint]
    pending = [_Item(fingerprint, task, 1) for fingerprint, task in wanted.items() if fingerprint not in records]
    runner = _backend(backend, workers, os.path.join(tempfile.gettempdir(), "hydroid-submitit"))
    call = _Call(store)
    done = len(wanted) - len(pending)
    alone: list[_Item] = []
    with Bar(progress, "sweeping") as bar:
        report = bar.callback
        while pending or alone:
            if pending:
                batch, pending = pending, []
            else:
                batch, alone = [alone[0]], alone[1:]
            for item, outcome in runner.run(call, iter(batch)):
                if outcome is None:
                    done += 1
                elif item.attempt <= retries:
                    next_attempt = item._replace(attempt=item.attempt + 1)
                    by_itself = isinstance(outcome, Lost) and not runner.exact
                    (alone if by_itself else pending).append(next_attempt)
                else:
                    error = outcome.error if isinstance(outcome, Lost) else outcome
                    about = _circumstances("failed", error, item.attempt, 0.0)
                    record = {"fingerprint": item.fingerprint, **item.task.labels, **about}
                    store.write(f"{_RECORDS}/{item.fingerprint}.json", _json(record))
                    done += 1
                if report is not None:
                    report(done / len(wanted))
            # Tasks that a broken pool had not begun.
            if not pending and not alone:
                left = set(wanted) - set(store.records(wanted))
                pending = [_Item(fingerprint, wanted[fingerprint], 1) for fingerprint in wanted if fingerprint in left]
    store.clean()
    found = store.records(wanted)
    gather(folder, storage_options=storage_options)
    return Sweep(store, [found[fingerprint] for fingerprint in wanted])


def gather(folder: str | os.PathLike[str], *, storage_options: Mapping[str, Any] | None = None) -> Any:
    """Write the records of a folder to its ``results.parquet``, and return them as a table of pyarrow.

    The table has a row for each task in the order of the fingerprints; labels with dots are columns.

    Parameters
    ----------
    folder : path or URL
        That of `sweep`.
    storage_options : mapping, optional
        Options of fsspec for a URL.

    Returns
    -------
    pyarrow.Table
    """
    import pyarrow
    import pyarrow.parquet

    url = os.fspath(folder)
    store = _Store(url if "://" in url else os.path.abspath(url), dict(storage_options or {}))
    records = store.records()
    columns: dict[str, None] = {}
    for record in records.values():
        columns.update(dict.fromkeys(record))
    # Text where a column has values of different kinds.
    table = {}
    for name in columns:
        values = [record.get(name) for record in records.values()]
        try:
            table[name] = pyarrow.array(values)
        except (pyarrow.ArrowInvalid, pyarrow.ArrowTypeError):
            try:
                table[name] = pyarrow.array(values, type=pyarrow.float64())
            except (pyarrow.ArrowInvalid, pyarrow.ArrowTypeError):
                texts = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
                table[name] = pyarrow.array(texts)
    whole = pyarrow.table(table)
    out = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(whole, out)
    store.write("results.parquet", out.getvalue().to_pybytes())
    return whole
