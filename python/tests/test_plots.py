import numpy as np
import pytest

import hydroid
from conftest import CHANNELS

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


def persistence(outputs, inputs, commands):
    return [outputs[-1]] * len(commands)


def test_errors_over_the_horizon(found, model, files):
    own = hydroid.evaluate(model, files[3], horizon=50)
    axes = hydroid.plot_horizon({"equations": own, "held": hydroid.evaluate(persistence, files[3], **CHANNELS, horizon=50)})
    assert len(axes) == 2 and [ax.get_ylabel() for ax in axes] == ["RMSE of u [m/s]", "RMSE of r [rad/s]"]
    lines = {line.get_label(): line for line in axes[1].get_lines()}
    assert list(lines) == ["equations", "held", "persistence"]
    np.testing.assert_array_equal(lines["equations"].get_ydata(), own.rmse[:, 1])
    np.testing.assert_array_equal(lines["held"].get_ydata(), lines["persistence"].get_ydata())
    np.testing.assert_allclose(lines["equations"].get_xdata()[-1], 5.0)
    again = hydroid.plot_horizon(found, metric="r2", axes=axes)
    assert again[0] is axes[0]
    with pytest.raises(ValueError, match="^metric: expected"):
        hydroid.plot_horizon(own, metric="mse")
    with pytest.raises(ValueError, match="^axes: expected 2 axes, got 1"):
        hydroid.plot_horizon(own, axes=axes[0])


def test_rollouts_begin_at_measurements(model, files):
    axes = hydroid.plot_rollouts(model, files[3], 40)
    measured, predicted = axes[0].get_lines()
    run = hydroid.prepare(files[3], **CHANNELS)[0]
    np.testing.assert_array_equal(measured.get_ydata(), run.outputs[:, 0])
    x, y = predicted.get_data()
    gaps = np.isnan(y)
    assert gaps.sum() == len(y) / 42
    starts = np.flatnonzero(gaps)[:-1] + 1
    np.testing.assert_array_equal(y[starts], run.outputs[np.rint(x[starts] / run.dt).astype(int), 0])
    with pytest.raises(ValueError, match="^run: expected an index below 1"):
        hydroid.plot_rollouts(model, files[3], 40, run=1)


def test_a_track_of_a_circle():
    dt, u, r = 0.1, 2.0, 0.1
    t = dt * np.arange(int(2 * np.pi / r / dt) + 1)
    # A log without any change is refused.
    log = hydroid.Log({"t [s]": t, "u": u + 1e-4 * np.sin(t), "v": 0 * t, "r": np.full_like(t, r), "n": 0 * t})
    run = hydroid.prepare(log, outputs="u,v,r", inputs="n")[0]
    ax = hydroid.plot_track(run)
    east, north = ax.get_lines()[0].get_data()
    # A turn to starboard: the centre is u / r to the east.
    np.testing.assert_allclose(np.hypot(north, east - u / r), u / r, rtol=1e-3)
    given = hydroid.plot_track({"x": north, "y": east}, label="again", ax=ax)
    assert given is ax and [text.get_text() for text in ax.get_legend().get_texts()][-1] == "again"
    with pytest.raises(ValueError, match="^tracks: expected runs with the outputs u, v, r"):
        hydroid.plot_track(log, outputs="u,r", inputs="n")


def test_trials_and_their_tracks():
    trials = hydroid.manoeuvres("simple", "turning-circle")
    axes = hydroid.plot_manoeuvre(trials)
    lines = axes[0].get_lines()
    assert len(lines) == len(trials.tracks) == 2
    for line, track in zip(lines, trials.tracks):
        np.testing.assert_array_equal(line.get_xdata(), track.y)
        np.testing.assert_array_equal(line.get_ydata(), track.x)
    np.testing.assert_allclose(axes[1].get_lines()[0].get_ydata(), np.degrees(trials.tracks[0].psi))
    one = hydroid.plot_manoeuvre({"a": trials, "b": trials}, trial=trials.tracks[0].trial)
    assert [text.get_text().split(",")[0] for text in one[0].get_legend().get_texts()] == ["a", "b"]
    ax = hydroid.plot_track(trials.tracks[0])
    assert len(ax.get_lines()) == 1 and trials.tracks[0].title in ax.get_legend().get_texts()[0].get_text()
    with pytest.raises(ValueError, match="^trial: expected a trial with a track, got 99"):
        hydroid.plot_manoeuvre(trials, trial=99)
