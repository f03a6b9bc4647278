from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _hydroid
from ._control import Guard
from ._hydroid import Model, Prediction, Step
from ._options import takes


@takes("adapt")
class Adapter:
    """A model that learns from each sample of a vessel.

    An adapter can be pickled and copied at any sample; the copy continues from there.

    Parameters
    ----------
    model : Model
    guard : bool or Guard
        Whether a guard checks the sensors and bounds the errors by those of the unchanged model, or its options.
    noise_logs : Log, path, Run, or list of these, optional
        Logs from which the noise is estimated where the model file does not state it.
    rehearsal : mapping, optional
        Windows of training logs that a Kalman filter rehearses: ``windows``, ``window_s`` [s], ``every``,
        ``state_variance``, ``noise_factor``.
    **options

    Notes
    -----
    None stands for the default; ``float("inf")`` switches a time constant off.
    """

    def __init__(
        self,
        model: Model,
        *,
        guard: bool | Guard = True,
        noise_logs: Any = None,
        rehearsal: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        self._given = {"guard": guard, "noise_logs": noise_logs, "rehearsal": rehearsal, **options}
        self._of = model
        self._inner = _hydroid.Adapter(model, guard=guard, noise_logs=noise_logs, rehearsal=rehearsal, **options)

    def __getstate__(self) -> dict[str, Any]:
        return {"model": self._of, "given": self._given, "state": self.state}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        self.__init__(saved["model"], **saved["given"])  # type: ignore[misc]
        self.state = saved["state"]

    def step(self, command: ArrayLike | None, output: ArrayLike, heading: float | None = None) -> Step:
        """Advance under the command since the last sample, and learn from the measurement now.

        Parameters
        ----------
        command : array_like, shape (inputs,), or None
            None before the first sample of a run.
        output : array_like, shape (outputs,)
            NaN is missing.
        heading : float, optional
            Heading [rad], for a model of the motion through the water.

        Returns
        -------
        Step
        """
        return self._inner.step(command, output, heading)

    def predict(self, commands: ArrayLike, horizons: Sequence[int]) -> Prediction:
        """Predict the outputs under commands from the present on.

        Parameters
        ----------
        commands : array_like, shape (samples, inputs)
        horizons : list of int
            Samples from 1 on, ascending.

        Returns
        -------
        Prediction
        """
        return self._inner.predict(commands, horizons)

    def reset(self) -> None:
        """Start a run; what was learned stays."""
        self._inner.reset()

    def freeze(self, frozen: bool) -> None:
        """Stop or resume learning.

        Parameters
        ----------
        frozen : bool
        """
        self._inner.freeze(frozen)

    @property
    def weights(self) -> NDArray[np.float64]:
        """The weights in use, in the order of the learner."""
        return self._inner.weights

    def model(self, runs: Sequence[str] = ()) -> Model:
        """The model with the learned weights.

        Parameters
        ----------
        runs : list of str
            Names of the runs, for the provenance of the model.

        Returns
        -------
        Model
        """
        return self._inner.model(list(runs))

    @property
    def state(self) -> bytes:
        """Everything that was learned. It can be set for an adapter of the same model and options."""
        return self._inner.state

    @state.setter
    def state(self, state: bytes) -> None:
        self._inner.state = state

    def __repr__(self) -> str:
        return repr(self._inner)
