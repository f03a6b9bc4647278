"""Vessels, simulated logs and manoeuvring trials against the command."""

import json
import os
import pickle
import subprocess
from pathlib import Path

import numpy as np
import pytest

import hydroid
from conftest import CHANNELS

VESSELS = Path(__file__).parents[2] / "vessels"


def command(*words, codes=(0,)):
    """Standard output of the command."""
    program = os.environ.get("HYDROID_COMMAND")
    if not program:
        pytest.skip("no HYDROID_COMMAND")
    done = subprocess.run([program, *map(str, words)], capture_output=True)
    assert done.returncode in codes, done.stderr.decode()
    return done.stdout


def flags(options):
    """Keyword arguments as options of the command."""
    words = []
    for name, value in options.items():
        words.append("--" + name.replace("_", "-"))
        if isinstance(value, (list, tuple)):
            words.append(",".join(str(x) for x in value))
        elif value is not True:
            words.append(str(value))
    return words


@pytest.fixture(scope="module")
def model_file(model, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "sindy.safetensors"
    model.save(path)
    return path


def test_built_in_vessels_have_files_that_are_read_back(tmp_path):
    assert hydroid.vessels() == ["simple", "hydrofoil", "hydrofoil-low-speed"]
    for name in hydroid.vessels():
        text = hydroid.vessel_toml(name)
        assert text.encode() == command("simulate", name, "--print-vessel")
        (tmp_path / "mine.toml").write_text(text)
        loaded = hydroid.Model.load(tmp_path / "mine.toml")
        assert loaded == hydroid.Model.load(name) == hydroid.Model.from_bytes(text.encode())
        assert loaded.output_names == ["u", "v", "r"]


@pytest.mark.parametrize("vessel", ["simple", "hydrofoil", *sorted(str(path) for path in VESSELS.glob("*.toml"))])
def test_vessels_survive_pickles(vessel):
    model = hydroid.Model.load(vessel)
    again = pickle.loads(pickle.dumps(model))
    assert again == model and again.to_bytes() == model.to_bytes()
    assert hydroid.vessel_toml(model) == hydroid.vessel_toml(vessel) == model.to_bytes().decode()


def test_text_that_is_no_vessel_is_refused(tmp_path):
    with pytest.raises(ValueError, match="mass|missing|unknown"):
        hydroid.Model.from_bytes(b"speed = 3\n")
    with pytest.raises(ValueError, match="no.*hydroid model|not a hydroid model"):
        hydroid.Model.from_bytes(b"t,u\n0,1\n")
    with pytest.raises(FileNotFoundError):
        hydroid.Model.load(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("plant", "excitation", "options"),
    [
        ("simple", "mixed", {"duration": 60, "seed": 3}),
        ("hydrofoil", "mixed", {"duration": 30, "dt": 0.05, "step": 0.005, "noise": 0.5, "current": (0.2, -0.1)}),
        ("hydrofoil", "low-speed", {"duration": 60, "speed": 2.0}),
        ("hydrofoil", "lawn-mower", {"leg": 60, "spacing": 20, "leg_speeds": [1.5, 4.0], "duration": 200}),
        ("simple", "lawn-mower", {"sharp_turns": True, "speed": 0.8, "duration": 60}),
        ("simple", "circle", {"radius": 12, "speed": 1.2, "duration": 60}),
        (str(VESSELS / "otter.toml"), "mixed", {"duration": 20, "dt": 0.05, "seed": 2}),
    ],
)
def test_logs_are_those_of_the_command(plant, excitation, options, tmp_path):
    log = hydroid.simulate(plant, excitation, **options)
    log.save(tmp_path / "python.csv")
    command("simulate", plant, "--excitation", excitation, *flags(options), "-o", tmp_path / "command.csv")
    assert (tmp_path / "python.csv").read_bytes() == (tmp_path / "command.csv").read_bytes()
    read = hydroid.read_log(tmp_path / "command.csv")
    assert (log.columns, log.units) == (read.columns, read.units) and len(log) == len(read)
    for name in log.columns:
        np.testing.assert_array_equal(log[name], read[name])


def test_models_simulate_the_logs_of_the_command(model, model_file, files, tmp_path):
    cases = [
        ("mixed", {"duration": 30, "seed": 4, "process_noise": 1.0}),
        ("mixed", {"duration": 20, "push": "n", "turn": "-delta", "noise": 0}),
        (files[3], {"start": 30, "duration": 20, "figure": tmp_path / "track.svg"}),
    ]
    for excitation, options in cases:
        command("simulate", model_file, "--excitation", excitation, *flags(options), "-o", tmp_path / "command.csv")
        drawn = (tmp_path / "track.svg").read_bytes() if "figure" in options else None
        for plant in (model, model_file):
            hydroid.simulate(plant, excitation, **options).save(tmp_path / "python.csv")
            assert (tmp_path / "python.csv").read_bytes() == (tmp_path / "command.csv").read_bytes()
        assert drawn is None or (tmp_path / "track.svg").read_bytes() == drawn
    # A log in memory is the log in its file, and a duration has a unit if it is text.
    log = hydroid.read_log(files[3])
    a, b = (hydroid.simulate(model, given, start=start) for given, start in ((log, "0.5m"), (files[3], 30)))
    np.testing.assert_array_equal(a["u"], b["u"])


def test_commands_of_logs_files_and_arrays_are_the_same(tmp_path):
    commands = {"t [s]": [0.0, 5.0, 10.0], "PP_cmd [N]": [100.0, 150.0, 120.0], "RD_cmd [N s]": [0.0, 10.0, -5.0]}
    hydroid.Log(commands).save(tmp_path / "commands.csv")
    pandas = pytest.importorskip("pandas")
    given = [commands, hydroid.Log(commands), pandas.DataFrame(commands), tmp_path / "commands.csv"]
    logs = [hydroid.simulate("simple", excitation) for excitation in given]
    assert len(logs[0]) == 101
    np.testing.assert_array_equal(logs[0]["PP_cmd"][[0, 49, 50, 100]], [100.0, 100.0, 150.0, 120.0])
    for log in logs[1:]:
        for name in log.columns:
            np.testing.assert_array_equal(log[name], logs[0][name])


def test_a_simulated_vessel_is_identified():
    logs = [hydroid.simulate("simple", duration=300, seed=seed) for seed in range(3)]
    assert len({log.name for log in logs}) == 3
    found = hydroid.identify(logs, outputs="u,v,r", methods="sindy", horizon="5s")
    assert found.judgement["sindy"].judged.nrmse[-1].max() < 0.2


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: hydroid.simulate("boat"), ["plant", "simple, hydrofoil", "'boat'"]),
        (lambda m: hydroid.simulate("simple", "spin"), ["'spin'", "lawn-mower"]),
        (lambda m: hydroid.simulate("simple", radius=3.0), ["radius cannot be used", "circle"]),
        (lambda m: hydroid.simulate("simple", process_noise=1.0), ["process_noise needs an identified model"]),
        (lambda m: hydroid.simulate("simple", figure="a.svg"), ["figure", "identified model"]),
        (lambda m: hydroid.simulate("simple", duration=-1), ["duration is -1"]),
        (lambda m: hydroid.simulate("simple", current=(1.0,)), ["current", "length 2"]),
        (lambda m: hydroid.simulate("simple", {"t": [0.0, 1.0], "n": [1.0, 1.0]}), ["excitation", "PP_cmd", "RD_cmd"]),
        (lambda m: hydroid.simulate(m, "circle"), ["one propeller and one rudder", "write mixed"]),
        (lambda m: hydroid.simulate(m, dt=0.5), ["dt needs a vessel"]),
        (lambda m: hydroid.simulate(m, push="thrust"), ["push", "no input 'thrust'"]),
        (lambda m: hydroid.vessel_toml(m), ["vessel", "identified model"]),
        (lambda m: hydroid.manoeuvres(m, "loop"), ["loop", "turning-circle"]),
        (lambda m: hydroid.manoeuvres("hydrofoil", steering=45), ["steering=45", "hard over is 30.0000 deg"]),
        (lambda m: hydroid.manoeuvres("simple", zigzag="10"), ["STEERING/HEADING"]),
        (lambda m: hydroid.manoeuvres("simple", speed=1.0, propulsion=50), ["speed", "propulsion", "one of them"]),
        (lambda m: hydroid.manoeuvres("simple", length=0), ["length=0", "metres"]),
        (lambda m: hydroid.manoeuvres("simple", turn="-rudder"), ["turn", "no input 'rudder'"]),
        (lambda m: hydroid.compare_manoeuvres(m, hydroid.simulate("simple", duration=9)), ["n"]),
    ],
)
def test_errors_name_the_argument(call, words, model):
    with pytest.raises(ValueError) as error:
        call(model)
    assert all(word in str(error.value) for word in words), str(error.value)
    assert "--" not in str(error.value)


def test_missing_files_and_wrong_types_have_their_exceptions(model, tmp_path):
    for call in (
        lambda: hydroid.simulate(tmp_path / "none.toml"),
        lambda: hydroid.simulate("simple", tmp_path / "none.csv"),
        lambda: hydroid.manoeuvres(tmp_path / "none.safetensors"),
    ):
        with pytest.raises(FileNotFoundError, match="none"):
            call()
    for call in (lambda: hydroid.simulate(3), lambda: hydroid.manoeuvres(None), lambda: hydroid.simulate("simple", 3)):
        with pytest.raises(TypeError, match="expected .*, got"):
            call()


def test_trials_are_those_of_the_command(tmp_path):
    trials = hydroid.manoeuvres("simple", length=2)
    command("manoeuvre", "simple", "--length", 2, "-o", tmp_path / "command", codes=(1,))
    assert trials.document == json.loads((tmp_path / "command" / "trials.json").read_text())
    assert not trials.passed
    trials.save(tmp_path / "python")
    names = sorted(path.name for path in (tmp_path / "command").iterdir())
    assert names == sorted(path.name for path in (tmp_path / "python").iterdir()) == ["report.html", "tracks.csv", "trials.json"]
    for name in ("tracks.csv", "trials.json"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    assert (tmp_path / "python" / "report.html").read_text() == trials.report()
    assert "Manoeuvring trials of simple" in trials.report()


def test_options_of_trials_are_those_of_the_command(tmp_path):
    for options in (
        {"steering": 40, "speed": 1.5, "current": (0.1, 0.2)},
        {"zigzag": "10/10,5/20", "propulsion": 60, "longest": "10m"},
        {"push": "PP_cmd", "turn": "RD_cmd", "steering": 50},
    ):
        given = dict(options, zigzag=[(10, 10), (5, 20)]) if "zigzag" in options else options
        trials = hydroid.manoeuvres("simple", ["turning-circle", "zigzag"], **given)
        words = ["manoeuvre", "simple", "--trials", "turning-circle,zigzag", *flags(options), "--json"]
        assert trials.document == json.loads(command(*words))


def test_figures_and_tracks_are_those_of_the_files(model, model_file, tmp_path):
    trials = hydroid.manoeuvres(model, "turning-circle,pull-out,spiral", threads=1)
    # The command names the file.
    document = json.loads(command("manoeuvre", model_file, "--trials", "turning-circle,pull-out,spiral", "--json"))
    assert dict(trials.document, plant=str(model_file)) == document and trials.document["plant"] == "sindy"
    assert hydroid.manoeuvres(model_file, "turning-circle,pull-out,spiral").document == document
    for figure in trials.figures:
        [same] = [f for f in document["trials"][figure["trial"]]["figures"] if f["name"] == figure["figure"]]
        assert same["value"] == figure["value"] and same.get("interval", [None, None]) == [figure["low"], figure["high"]]
    first = trials.figures[0]
    assert (first["figure"], first["unit"], first["limit"]) == ("advance_m", "m", None)
    assert len(trials.to_pandas()) == len(trials.figures)
    assert "turning circle" in repr(trials) and "advance_m" in repr(trials) and "<table>" in trials._repr_html_()
    # Two circles and a pull-out with two tracks; a spiral has none.
    assert [track.trial for track in trials.tracks] == [0, 1, 2, 2]
    trials.save(tmp_path / "trials")
    rows = [line.split(",") for line in (tmp_path / "trials" / "tracks.csv").read_text().splitlines()[1:]]
    for number, track in enumerate(trials.tracks):
        table = np.array([row[2:] for row in rows if row[0] == str(number)], dtype=float)
        mine = np.column_stack([track.t, track.commands, track.x, track.y, track.psi, track.outputs])
        np.testing.assert_array_equal(mine, table)
        assert track.outputs.shape[1] == len(hydroid._vessels.MOTION) and track.commands.shape[1] == len(trials.input_names)


def test_trials_in_logs_are_compared_as_by_the_command(model, model_file, tmp_path):
    # Straight, hard over to starboard, straight.
    commands = {"t [s]": [0.0, 20.0, 80.0, 100.0], "n": [80.0] * 4, "delta [rad]": [0.0, 0.3, 0.0, 0.0]}
    log = hydroid.simulate(model, commands, name="circle.csv")
    log.save(tmp_path / "circle.csv")
    compared = hydroid.compare_manoeuvres(model, tmp_path / "circle.csv")
    command("manoeuvre", model_file, tmp_path / "circle.csv", "-o", tmp_path / "command")
    document = json.loads((tmp_path / "command" / "comparisons.json").read_text())
    assert dict(compared.document, plant=str(model_file)) == document and len(document["comparisons"]) == 1
    hydroid.compare_manoeuvres(model_file, tmp_path / "circle.csv").save(tmp_path / "python")
    for name in ("tracks.csv", "comparisons.json"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    assert "circle.csv" in (tmp_path / "python" / "report.html").read_text() and compared.report().startswith("<!DOCTYPE")
    figures = {figure["figure"]: figure for figure in compared.figures}
    rate = figures["steady_yaw_rate_deg_s"]
    assert rate["predicted"] == pytest.approx(rate["measured"], rel=0.05) and not rate["in_training"]
    # A log without sway measures distances by its positions.
    advance = figures["advance_m"]
    assert advance["measured_low"] <= advance["measured"] <= advance["measured_high"]
    assert advance["error"] == pytest.approx(advance["measured"] - advance["predicted"])
    assert log.columns.count("x") == 1
    [tracks] = compared.tracks
    assert tracks.measured.t[0] == 0.0 and tracks.predicted.outputs.shape == (len(tracks.predicted.t), 3)
    assert tracks.measured.commands is None and "advance_m" in repr(compared)
    # The log in memory has the same trials.
    assert hydroid.compare_manoeuvres(model, log).figures == compared.figures
    straight = hydroid.simulate(model, dict(commands, **{"delta [rad]": [0.0] * 4}), noise=0)
    assert hydroid.compare_manoeuvres(model, straight).figures == []


def test_a_log_is_saved_with_its_values(files, tmp_path):
    log = hydroid.Log({"t [s]": [0.0, 1e-7, 2.0], 'odd, "name" [kn]': [1 / 3, np.nan, -1e300]})
    log.save(tmp_path / "odd.csv")
    again = hydroid.read_log(tmp_path / "odd.csv")
    assert (again.columns, again.units) == (log.columns, log.units)
    for name in log.columns:
        np.testing.assert_array_equal(again[name], log[name])
    with pytest.raises(OSError, match="run0.csv/below"):
        log.save(files[0] / "below")


@pytest.mark.parametrize(
    "call",
    [
        lambda **options: hydroid.simulate("hydrofoil", duration=4e6, **options),
        lambda **options: hydroid.simulate(VESSELS / "otter.toml", duration=4e6, **options),
        lambda **options: hydroid.manoeuvres(VESSELS / "mariner.toml", ["turning-circle"] * 300, **options),
    ],
)
def test_ctrl_c_and_exceptions_end_a_call(call, ctrl_c):
    with pytest.raises(KeyboardInterrupt):
        call()
    told = []

    def progress(fraction):
        told.append(fraction)
        if len(told) == 3:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        call(progress=progress)
    assert told == sorted(told) and 0 <= told[0] < told[-1] < 1


def test_a_rudder_as_the_only_input_does_not_push(tmp_path):
    log = Path(__file__).parents[2] / "tests" / "golden" / "tanker.csv"
    model = hydroid.identify([str(log)], inputs="delta", methods="sindy", horizon="10s").best
    assert model.roles == {"delta": "steering"}
    trials = hydroid.manoeuvres(model, "turning-circle", steering=35)
    assert trials.document["propulsion"] is None and "delta (steering)" in trials.document["no_propulsion"]
    assert abs(trials.document["approach_speed_m_s"] - 1.786) < 0.02
    with pytest.raises(ValueError, match="no input 'detla'|no such input"):
        hydroid.manoeuvres(model, "turning-circle", role={"detla": "steering"})
    with pytest.raises(ValueError, match="role"):
        hydroid.manoeuvres(model, "turning-circle", role={"delta": "rudder"})


def test_roles_limits_and_neutral_values_as_text():
    options = {"trials": "turning-circle", "speed": 1.5, "steering": 40}
    table = hydroid.manoeuvres("simple", limit={"RD_cmd": (-20, 20)}, neutral={"RD_cmd": 0.0}, **options)
    text = hydroid.manoeuvres("simple", limit="RD_cmd=-20:20", neutral="RD_cmd=0", **options)
    assert text.figures == table.figures
    with pytest.raises(ValueError, match='^steering=150: .* as in limit="NAME=LOW:HIGH"'):
        hydroid.manoeuvres("simple", trials="turning-circle", steering=150)
    with pytest.raises(ValueError, match="^role: 'delta' is not INPUT=ROLE"):
        hydroid.manoeuvres("simple", role="delta", trials="zigzag")
    with pytest.raises(ValueError, match="^speed and propulsion both"):
        hydroid.manoeuvres("simple", speed=1.5, propulsion=50)
