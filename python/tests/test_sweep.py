import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import hydroid
import sweep_tasks
from conftest import CHANNELS

for package in ("fsspec", "pyarrow"):
    pytest.importorskip(package)

BACKENDS = ["serial", "joblib", "ray", "dask", "submitit"]
SETTINGS = {"log": {"outputs": ["u", "r"], "inputs": ["n", "delta"]}, "identify": {"horizon": 20}}
QUICK = {
    "sindy": {
        "lag": "none", "gate": "none", "refine": False, "members": 0, "window_s": 1.0, "threshold": 0.02, "ridge": 1e-6,
        "signed_squares": True,
    }
}


def available(backend):
    if backend != "serial":
        pytest.importorskip({"dask": "distributed"}.get(backend, backend))


def squares(n=8):
    return hydroid.grid(sweep_tasks.square, {}, {"x": range(n)}, suffix=".txt")


def contents(folder):
    return {path.name: path.read_bytes() for path in Path(folder, "files").iterdir()}


def check_complete(sweep, n):
    """Every task has exactly one record and one file."""
    assert len(sweep.records) == n and not sweep.failed
    folder = Path(sweep.folder)
    assert len(list((folder / "records").iterdir())) == n
    assert {record["fingerprint"] for record in sweep.records} == {path.stem for path in (folder / "files").iterdir()}
    for record in sweep.records:
        assert hashlib.sha256(sweep.read(record)).hexdigest() == record["sha256"]


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_backend_runs_each_task_once(backend, tmp_path):
    available(backend)
    fractions = []
    sweep = hydroid.sweep(squares(), tmp_path, backend=backend, workers=2, progress=fractions.append)
    check_complete(sweep, 8)
    assert [record["square"] for record in sweep.records] == [x * x for x in range(8)]
    assert [record["x"] for record in sweep.records] == list(range(8))
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    assert repr(sweep) == f"Sweep({str(tmp_path)!r}: 8 tasks done, 0 failed)"


def test_backends_give_the_same_bytes(files, tmp_path):
    tasks = hydroid.grid(
        hydroid.fit, {"logs": files[:2], "config": {**SETTINGS, **QUICK}}, {"config.sindy.degree": [1, 2]}
    )
    results = {}
    for backend in BACKENDS[:-1]:
        try:
            available(backend)
        except pytest.skip.Exception:
            continue
        sweep = hydroid.sweep(tasks, tmp_path / backend, backend=backend, workers=2)
        check_complete(sweep, 2)
        differing = ("seconds", "peak_memory_mb", "host", "attempts")
        records = [{k: v for k, v in record.items() if k not in differing} for record in sweep.records]
        results[backend] = (contents(tmp_path / backend), records)
    assert all(result == results["serial"] for result in results.values())
    assert len(results) > 1
    # The task of a sweep is the identification.
    found = hydroid.identify(files[:2], **CHANNELS, methods="sindy", horizon=20, sections={"sindy": {"degree": 2, **QUICK["sindy"]}})
    again = hydroid.sweep(tasks, tmp_path / "serial", backend="serial")
    record = next(r for r in again.records if r["config.sindy.degree"] == 2)
    assert again.model(record) == found.best
    assert record["score"] == found.judgement["sindy"].judged.score
    assert again.best()["score"] == min(r["score"] for r in again.records)


def test_a_sweep_goes_on_where_it_was(tmp_path):
    first = hydroid.sweep(squares(3), tmp_path, backend="serial")
    times = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "records").iterdir()}
    fractions = []
    whole = hydroid.sweep(squares(5) + squares(5), tmp_path, backend="serial", progress=fractions.append)
    check_complete(whole, 5)
    assert len(fractions) == 2
    assert all((tmp_path / "records" / name).stat().st_mtime_ns == t for name, t in times.items())
    assert whole.records[:3] == first.records


def test_failures_are_retried_and_recorded(tmp_path):
    tasks = [hydroid.Task(sweep_tasks.fails, {"x": 1}), hydroid.Task(sweep_tasks.square, {"x": 2})]
    sweep = hydroid.sweep(tasks, tmp_path, backend="serial", retries=1)
    failed = sweep.records[0]
    assert failed["status"] == "failed" and failed["attempts"] == 2
    assert failed["error"].startswith("ValueError: the value 1 cannot be used\n") and "in fails" in failed["error"]
    assert sweep.records[1]["status"] == "done"
    assert repr(sweep).endswith("1 tasks done, 1 failed; the first: ValueError: the value 1 cannot be used)")
    with pytest.raises(ValueError, match="expected a task with a file"):
        sweep.read(failed)
    # A recorded failure stays, unless it is to run again.
    assert hydroid.sweep(tasks, tmp_path, backend="serial").records[0]["attempts"] == 2
    assert hydroid.sweep(tasks, tmp_path, backend="serial", retries=0, rerun_failed=True).records[0]["attempts"] == 1
    # A record that cannot be stored is a failure of its task.
    wrong = hydroid.sweep([hydroid.Task(sweep_tasks.no_record, {})], tmp_path / "wrong", backend="serial").records[0]
    assert wrong["status"] == "failed" and wrong["error"].startswith("TypeError: record: expected numbers")
    marks = tmp_path / "marks"
    marks.mkdir()
    once = hydroid.Task(sweep_tasks.fails_once, {"x": 1, "folder": str(marks)})
    done = hydroid.sweep([once], tmp_path / "once", backend="serial").records[0]
    assert (done["status"], done["attempts"], done["x"]) == ("done", 2, 1)


@pytest.mark.parametrize("always", [False, True])
@pytest.mark.parametrize("backend", BACKENDS[1:])
def test_a_task_that_ends_its_process(backend, always, tmp_path):
    available(backend)
    if backend == "submitit" and always:
        pytest.skip("the local jobs of submitit take minutes to tell")
    arguments = {"folder": str(tmp_path), "always": always}
    tasks = hydroid.grid(sweep_tasks.ends_its_process, arguments, {"x": range(6)})
    sweep = hydroid.sweep(tasks, tmp_path / "out", backend=backend, workers=2, retries=1)
    assert [record["status"] for record in sweep.records] == ["failed" if always and x == 3 else "done" for x in range(6)]
    assert len(list((tmp_path / "out" / "records").iterdir())) == 6
    if always:
        assert sweep.records[3]["error"] and sweep.records[3]["attempts"] == 2


def test_ray_loses_a_worker_in_the_middle(tmp_path):
    ray = pytest.importorskip("ray")
    marks = tmp_path / "marks"
    marks.mkdir()
    tasks = hydroid.grid(sweep_tasks.noted, {"folder": str(marks)}, {"x": range(30)})
    killed = []

    def kill():
        # The worker of the sixth task that begins.
        while len(list(marks.iterdir())) < 6:
            time.sleep(0.01)
        latest = max(marks.iterdir(), key=lambda path: int(path.name.split("-")[2]))
        killed.append(int(latest.name.split("-")[1]))
        os.kill(killed[0], signal.SIGKILL)

    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        thread = threading.Thread(target=kill)
        thread.start()
        sweep = hydroid.sweep(tasks, tmp_path / "out", backend="ray")
        thread.join()
    finally:
        ray.shutdown()
    check_complete(sweep, 30)
    pids = {record["pid"] for record in sweep.records}
    assert killed and len(pids) >= 2
    assert [record["x"] for record in sweep.records] == list(range(30))
    # The task of that worker began twice, all others once.
    begun = [int(path.name.split("-")[0]) for path in marks.iterdir()]
    assert sorted(set(begun)) == list(range(30)) and len(begun) == 31


def test_ray_loses_its_driver(tmp_path):
    pytest.importorskip("ray")
    marks = tmp_path / "marks"
    marks.mkdir()
    driver = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import hydroid, sweep_tasks
tasks = hydroid.grid(sweep_tasks.noted, {{"folder": {str(marks)!r}}}, {{"x": range(30)}})
hydroid.sweep(tasks, {str(tmp_path / "out")!r}, backend="ray", workers=2)
"""
    process = subprocess.Popen([sys.executable, "-c", driver], stderr=subprocess.PIPE)
    records = tmp_path / "out" / "records"
    deadline = time.time() + 120
    while not records.exists() or len(list(records.glob("*.json"))) < 5:
        assert process.poll() is None and time.time() < deadline, process.stderr.read()
        time.sleep(0.02)
    process.kill()
    process.wait()
    before = {path.name: path.read_bytes() for path in records.glob("*.json")}
    assert 5 <= len(before) < 30
    tasks = hydroid.grid(sweep_tasks.noted, {"folder": str(marks)}, {"x": range(30)})
    sweep = hydroid.sweep(tasks, tmp_path / "out", backend="ray", workers=2)
    check_complete(sweep, 30)
    # What was done before was not done again.
    assert all((records / name).read_bytes() == content for name, content in before.items())
    assert not list((tmp_path / "out").rglob(".part-*"))


def test_results_are_a_parquet_data_set(tmp_path):
    duckdb = pytest.importorskip("duckdb")
    polars = pytest.importorskip("polars")
    hydroid.sweep(squares(), tmp_path, backend="serial")
    file = tmp_path / "results.parquet"
    total = duckdb.sql(f"select sum(square), count(distinct fingerprint) from '{file}'").fetchall()[0]
    assert total == (sum(x * x for x in range(8)), 8)
    assert polars.read_parquet(file)["x"].sort().to_list() == list(range(8))
    frame = hydroid.sweep(squares(), tmp_path, backend="serial").to_pandas()
    assert list(frame["x"]) == list(range(8))


def test_results_in_an_object_store(tmp_path):
    moto = pytest.importorskip("moto.server")
    pytest.importorskip("s3fs")
    server = moto.ThreadedMotoServer(port=0)
    server.start()
    try:
        host, port = server.get_host_and_port()
        options = {"key": "test", "secret": "test", "client_kwargs": {"endpoint_url": f"http://127.0.0.1:{port}"}}
        import s3fs

        s3fs.S3FileSystem(**options).mkdir("results")
        run = lambda n: hydroid.sweep(squares(n), "s3://results/one", backend="joblib", workers=2, storage_options=options)
        assert len(run(4).records) == 4
        sweep = run(6)
        assert [record["square"] for record in sweep.records] == [x * x for x in range(6)]
        assert sweep.read(sweep.records[5]) == b"25 0"
        assert hydroid.gather("s3://results/one", storage_options=options).num_rows == 6
    finally:
        server.stop()


def test_fingerprints_tell_tasks_apart(files, tmp_path):
    task = lambda **arguments: hydroid.Task(sweep_tasks.square, arguments).fingerprint
    assert task(x=1) == task(x=1) == task(x=np.int64(1))
    prints = {task(x=1), task(x=2), task(x=1, seed=1), task(x="1"), task(x=[1]), task(x=None), task(x=np.ones(1))}
    assert len(prints) == 7
    assert hydroid.Task(sweep_tasks.square, {"x": 1}, version="2").fingerprint != task(x=1)
    assert hydroid.Task(sweep_tasks.square, {"x": 1}, labels={"a": 1}).fingerprint != task(x=1)
    # A file counts by its content, not by its name.
    copy = tmp_path / "copy.csv"
    copy.write_bytes(files[0].read_bytes())
    assert task(x=copy) == task(x=files[0]) != task(x=files[1])
    assert task(x=hydroid.read_log(copy)) == task(x=hydroid.read_log(files[0]))
    with pytest.raises(TypeError, match="^arguments: expected numbers"):
        task(x=object())


def test_random_searches_are_reproducible():
    draw = lambda n: hydroid.random_search(sweep_tasks.square, {}, {"x": lambda rng: rng.uniform()}, n, seed=1)
    long, short = draw(5), draw(3)
    assert [task.fingerprint for task in long[:3]] == [task.fingerprint for task in short]
    assert len({task.fingerprint for task in long}) == 5
    assert long[0].labels["x"] == long[0].arguments["x"]


def test_a_fleet_from_a_table(files, tmp_path):
    pandas = pytest.importorskip("pandas")
    rows = [{"vessel": name, "log": str(file), "role": role} for name in ("a", "b") for file, role in zip(files, ["train", "train", "test"])]
    tasks = hydroid.fleet(rows, {"config": {**SETTINGS, **QUICK}})
    assert [task.labels["vessel"] for task in tasks] == ["a", "b"]
    assert [len(task.arguments["logs"]) for task in tasks] == [2, 2]
    of_frame = hydroid.fleet(pandas.DataFrame(rows), {"config": {**SETTINGS, **QUICK}})
    assert [task.fingerprint for task in of_frame] == [task.fingerprint for task in tasks]
    sweep = hydroid.sweep(tasks, tmp_path, backend="serial")
    assert [record["vessel"] for record in sweep.records] == ["a", "b"]
    # Both vessels have the same logs here.
    assert sweep.model(sweep.records[0]) == sweep.model(sweep.records[1])
    assert {"nrmse_u", "rmse_r", "persistence_nrmse_u", "grade_r", "score"} <= set(sweep.records[0])
    with pytest.raises(ValueError, match="^table: expected the columns vessel and log"):
        hydroid.fleet([{"name": "a"}])
    with pytest.raises(ValueError, match="^table: expected the roles"):
        hydroid.fleet([{"vessel": "a", "log": "x", "role": "judge"}])
    with pytest.raises(ValueError, match="role train for each vessel, got none for a"):
        hydroid.fleet([{"vessel": "a", "log": "x", "role": "test"}])


def test_monte_carlo_of_closed_loops(tmp_path):
    options = {"controller": "fl", "radius": 10.0, "duration": 60.0, "speed": 1.0, "evaluate_from": 30.0}
    arguments = {"plant": "simple", "model": "simple", "options": options}
    tasks = hydroid.grid(hydroid.closed_loop, arguments, {"options.mass": [1.0, 1.2], "seed": [0, 1]})
    sweep = hydroid.sweep(tasks, tmp_path, backend="serial")
    assert not sweep.failed and [record["options.mass"] for record in sweep.records] == [1.0, 1.0, 1.2, 1.2]
    whole = hydroid.control("simple", "simple", seed=1, mass=1.2, **options)
    assert sweep.records[3]["rms_position"] == whole.metrics["rms_position"]
    assert len({record["rms_position"] for record in sweep.records}) == 4
    assert all("file" not in record for record in sweep.records)


def test_errors_name_the_argument(tmp_path):
    with pytest.raises(ValueError, match="^backend: expected one of serial"):
        hydroid.sweep(squares(1), tmp_path, backend="slurm")
    with pytest.raises(TypeError, match="^backend: expected"):
        hydroid.sweep(squares(1), tmp_path, backend=3)
    with pytest.raises(TypeError, match="^tasks: expected hydroid.Task"):
        hydroid.sweep([1], tmp_path)
    with pytest.raises(ValueError, match=r"^arguments and axes: expected arguments of fit \(logs, config.*got 'confg'"):
        hydroid.grid(hydroid.fit, {"logs": "a.csv"}, {"confg.sindy.degree": [1]})
    with pytest.raises(TypeError, match="^axes: expected a list of values at 'seed', got 3"):
        hydroid.grid(hydroid.fit, {"logs": "a.csv"}, {"seed": 3})
    with pytest.raises(ValueError, match="^retries"):
        hydroid.sweep([], tmp_path, retries=-1)
