import numpy as np
import pytest

import hydroid
from conftest import CHANNELS, DT


def test_a_file_a_mapping_and_data_frames_are_the_same_log(files, voyages):
    pandas, polars, pyarrow = (pytest.importorskip(name) for name in ("pandas", "polars", "pyarrow"))
    logs = [
        hydroid.read_log(files[0]),
        hydroid.Log(voyages[0]),
        hydroid.Log(pandas.DataFrame(voyages[0])),
        hydroid.Log(polars.DataFrame(voyages[0])),
        hydroid.Log(pyarrow.table(voyages[0])),
    ]
    for log in logs:
        assert log.columns == ["t", "u", "r", "n", "delta"]
        assert log.units == {"t": "s", "u": "m/s", "r": "rad/s", "n": None, "delta": "rad"}
        for name, heading in zip(log.columns, voyages[0]):
            np.testing.assert_array_equal(log[name], voyages[0][heading])
    back = polars.DataFrame(logs[0])
    np.testing.assert_array_equal(back["u [m/s]"].to_numpy(), voyages[0]["u [m/s]"])
    assert pyarrow.table(logs[0]).num_rows == len(logs[0])


def test_a_run_is_in_si_units(voyages):
    columns = dict(voyages[0])
    knots = columns.pop("u [m/s]") / (1852 / 3600)
    [run] = hydroid.prepare(hydroid.Log({**columns, "speed": knots}, units={"speed": "kn"}), outputs="u=speed,r", inputs=["n", "delta"])
    np.testing.assert_allclose(run.outputs[:, 0], voyages[0]["u [m/s]"], rtol=1e-12)
    assert (run.output_names, run.input_names, run.dt) == (["u", "r"], ["n", "delta"], pytest.approx(DT))
    assert run.units["u"] == "m/s" and run.inputs.shape == (len(run), 2) and len(run.t) == len(run)


def test_times_of_data_frames_are_seconds(voyages):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(voyages[0]).drop(columns="t [s]")
    frame["time"] = pandas.Timestamp("2024-05-01") + pandas.to_timedelta(np.round(1e3 * voyages[0]["t [s]"]), unit="ms")
    [run] = hydroid.prepare(hydroid.Log(frame), time="time", **CHANNELS)
    assert run.dt == pytest.approx(DT) and run.t[0] == pytest.approx(pandas.Timestamp("2024-05-01").timestamp())
    arrays = {name: frame[name].to_numpy() for name in frame}
    assert hydroid.Log(arrays)["time"][1] == pytest.approx(run.t[1])
    # Times of day go on after midnight.
    frame["time"] = (pandas.Timestamp("2024-05-01T23:59:55") + pandas.to_timedelta(np.round(1e3 * voyages[0]["t [s]"]), unit="ms")).strftime("%H:%M:%S.%f")
    [run] = hydroid.prepare(hydroid.Log(frame), time="time", **CHANNELS)
    assert run.dt == pytest.approx(DT) and len(run) == len(frame) and run.t[-1] > 86_400


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (lambda: hydroid.Log([1.0]), TypeError, ["data", "mapping", "list"]),
        (lambda: hydroid.Log({"u": ["a", "b"]}), TypeError, ["data['u']", "numbers", "dtype <U1"]),
        (lambda: hydroid.Log({"u": [1j]}), TypeError, ["data['u']", "complex128"]),
        (lambda: hydroid.Log({"u": np.ones((2, 2))}), ValueError, ["data['u']", "one dimension", "[2, 2]"]),
        (lambda: hydroid.Log({"u": [1.0, 2.0], "n": [1.0]}), ValueError, ["'n' has 1", "'u' has 2"]),
        (lambda: hydroid.Log({"u": [1.0]}, units={"v": "kn"}), ValueError, ["units", "(u)", "'v'"]),
        (lambda: hydroid.Log({}), ValueError, []),
        (lambda: hydroid.read_log("nowhere.csv"), FileNotFoundError, ["nowhere.csv"]),
        (lambda: hydroid.prepare(3), TypeError, ["logs", "Log objects or paths", "int"]),
    ],
)
def test_errors_name_argument_expected_and_given(make, kind, words):
    with pytest.raises(kind) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)


def test_a_wrong_channel_is_named(files):
    with pytest.raises(ValueError, match="'?speed'?"):
        hydroid.prepare(files[0], outputs="speed", inputs="n")
    with pytest.raises(ValueError, match="a step of -1"):
        hydroid.prepare(files[0], **CHANNELS, dt=-1.0)
    with pytest.raises(ValueError, match='name the commands, for example inputs="n=RPM,delta=RUDDER"'):
        hydroid.prepare({"t": [0.0, 0.1, 0.2], "u": [1.0, 2.0, 3.0]})
    with pytest.raises(ValueError, match="unknown field `gap`"):
        hydroid.prepare(files[0], **CHANNELS, gap=1.0)


def test_repr_names_the_columns(files):
    assert "u [m/s]" in repr(hydroid.read_log(files[0]))


def test_options_replace_those_of_a_model(model, files):
    own, late = (hydroid.rollouts(model, files[0], 10, **options)[0].run for options in ({}, {"input_delay": 3}))
    assert late.t[0] == pytest.approx(3 * DT) and len(late) == len(own) - 3
    # The command of a row acts three samples later, when the outputs of that time are measured.
    np.testing.assert_array_equal(late.inputs, own.inputs[:-3])
    np.testing.assert_array_equal(late.outputs, own.outputs[3:])


def test_data_frames_and_mappings_are_logs(files, voyages):
    pandas = pytest.importorskip("pandas")
    [read] = hydroid.prepare(files[0], **CHANNELS)
    for given in (pandas.DataFrame(voyages[0]), voyages[0]):
        [run] = hydroid.prepare(given, **CHANNELS)
        assert run.name == "logs"
        np.testing.assert_array_equal(run.outputs, read.outputs)
    assert [run.name for run in hydroid.prepare([files[0], voyages[1]], **CHANNELS)] == ["run0.csv", "logs[1]"]


def test_recording_with_a_configuration_file(tmp_path):
    """A folder of topics: outputs of one, held commands of another."""
    folder = tmp_path / "boat"
    folder.mkdir()
    rows = [f"{1.77e9 + 0.1 * k:.1f},{0.5 * k},{-0.01 * k}" for k in range(50)]
    (folder / "motion.csv").write_text("t [s],speed [kn],rate [deg/s]\n" + "\n".join(rows) + "\n")
    (folder / "cmd.csv").write_text("t [s],rudder [deg]\n1770000000.0,5\n1770000002.0,-5\n")
    config = tmp_path / "hydroid.toml"
    config.write_text(
        '[log]\noutputs = ["u=motion.speed", "r=motion.rate * -1"]\ninputs = ["rudder=cmd.rudder"]\n'
    )
    log = hydroid.read_log(folder, config=config)
    assert log.columns == ["t", "u", "r", "rudder"]
    np.testing.assert_allclose(log["u"], 0.5 * np.arange(50) * 1852 / 3600, rtol=1e-12)
    np.testing.assert_allclose(log["r"], np.radians(0.01 * np.arange(50)), rtol=1e-12)
    np.testing.assert_allclose(log["rudder"][[0, 19, 20]], np.radians([5, 5, -5]), rtol=1e-12)
    with pytest.raises(ValueError, match="no output is named"):
        hydroid.read_log(folder)
    config.write_text('[log]\noutputs = ["u=motion.sped"]\ninputs = ["cmd.rudder"]\n')
    with pytest.raises(ValueError, match="did you mean `motion.speed`"):
        hydroid.read_log(folder, config=config)
