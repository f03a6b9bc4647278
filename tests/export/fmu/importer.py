"""An FMU in FMPy, version 2 or 3, by names of variables."""

import tempfile

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

KINDS = [
    "affine", "committee", "current", "direct", "direct_grey_box", "equations", "equations_lag", "equations_past",
    "gru_feedback", "gru_grey_box", "hostile", "hydrofoil", "lstm", "mariner", "no_motion", "otter", "otter_50ms",
    "rate_limit", "simple", "tug",
]  # fmt: skip

VERSIONS = [2, 3]


class Importer:
    def __init__(self, path, version, exchange=False, unpacked=None):
        self.version = version
        # Deleted with the interpreter, also after an error.
        self.own = None if unpacked else tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.folder = unpacked or fmpy.extract(str(path), self.own.name)
        self.description = fmpy.read_model_description(str(self.folder), validate=False)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        kinds = {2: (FMU2Slave, FMU2Model), 3: (FMU3Slave, FMU3Model)}
        interface = self.description.modelExchange if exchange else self.description.coSimulation
        self.fmu = kinds[version][exchange](
            instanceName="vessel",
            guid=self.description.guid,
            unzipDirectory=str(self.folder),
            modelIdentifier=interface.modelIdentifier,
        )
        self.fmu.instantiate()

    def start(self, parameters, start_time=0.0):
        if self.version == 2:
            self.fmu.setupExperiment(startTime=start_time)
            self.set(parameters)
            self.fmu.enterInitializationMode()
        else:
            self.set(parameters)
            self.fmu.enterInitializationMode(startTime=start_time)
        self.fmu.exitInitializationMode()

    def set(self, values):
        put = self.fmu.setReal if self.version == 2 else self.fmu.setFloat64
        put([self.references[name] for name in values], list(values.values()))

    def get(self, names):
        get = self.fmu.getReal if self.version == 2 else self.fmu.getFloat64
        return np.array(get([self.references[name] for name in names]))

    def step(self, t, h):
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def state(self):
        return self.fmu.getFMUstate() if self.version == 2 else self.fmu.getFMUState()

    def set_state(self, state):
        self.fmu.setFMUstate(state) if self.version == 2 else self.fmu.setFMUState(state)

    def serialize(self, state):
        return self.fmu.serializeFMUstate(state) if self.version == 2 else self.fmu.serializeFMUState(state)

    def deserialize(self, content):
        return self.fmu.deSerializeFMUstate(content) if self.version == 2 else self.fmu.deserializeFMUState(content)

    def close(self):
        """Frees the instance. The library stays loaded where another instance uses it."""
        self.fmu.freeInstance()
        if self.own:
            self.own.cleanup()


def difference(a, b):
    """Largest difference, relative to the larger of 1 and the value."""
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    return float(np.max(np.abs(a - b) / np.maximum(1.0, np.abs(b))))
