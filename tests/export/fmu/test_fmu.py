"""FMUs in FMPy: the schema, and runs that agree with the rollouts of the models."""

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from importer import KINDS, VERSIONS, Importer, difference

kinds = pytest.mark.parametrize("kind", KINDS)
versions = pytest.mark.parametrize("version", VERSIONS)


def fmu(folder, kind, version):
    return folder / f"{kind}_fmi{version}.fmu"


def run(importer, golden, samples, first=0):
    """Rows of the outputs after the samples from the first one on."""
    dt, rows = golden["dt"], []
    for k in range(first, first + samples):
        importer.set(dict(zip(golden["inputs"], golden["commands"][k])))
        importer.step(k * dt, dt)
        rows.append(importer.get(golden["outputs"]))
    return np.array(rows)


def test_all_kinds_are_here(folder):
    assert {path.stem for path in folder.glob("*.fmu")} == {f"{k}_fmi{v}" for k in KINDS for v in VERSIONS}


@kinds
@versions
def test_the_description_is_valid(folder, kind, version):
    assert validate_fmu(str(fmu(folder, kind, version))) == []


@kinds
@versions
def test_a_run_is_the_rollout_of_the_model(folder, manifest, kind, version):
    golden = manifest(kind)
    importer = Importer(fmu(folder, kind, version), version)
    importer.start(golden["parameters"])
    rows = run(importer, golden, 1000)
    importer.close()
    assert difference(rows, golden["expected"]) < 1e-12
    assert np.std(rows, axis=0).min() > 1e-4


@kinds
@versions
def test_a_run_is_saved_loaded_and_repeated(folder, manifest, kind, version):
    golden = manifest(kind)
    expected, dt = np.array(golden["expected"]), golden["dt"]
    first = Importer(fmu(folder, kind, version), version)
    first.start(golden["parameters"])
    run(first, golden, 500)
    content = first.serialize(first.state())
    # A second instance, from another copy of the FMU, goes on from the middle.
    second = Importer(fmu(folder, kind, version), version)
    second.start({})
    second.set_state(second.deserialize(content))
    assert difference(run(second, golden, 500, 500), expected[500:]) < 1e-12
    # The first one goes on from its state after it went astray, with steps of changing length.
    state = first.state()
    first.set(dict(zip(golden["inputs"], golden["commands"][0])))
    first.step(500 * dt, 3.3 * dt)
    first.set_state(state)
    for k in range(500, 520):
        first.set(dict(zip(golden["inputs"], golden["commands"][k])))
        passed = 0.0
        for share in [[1.0], [0.5, 0.5], [0.125, 0.375, 0.5]][k % 3]:
            first.step((k + passed) * dt, share * dt)
            passed += share
        assert difference(first.get(golden["outputs"]), expected[k]) < 1e-11
    first.fmu.reset()
    first.start(golden["parameters"])
    assert difference(run(first, golden, 100), expected[:100]) < 1e-12
    first.close()
    second.close()


@kinds
@versions
def test_fmpy_simulates_it(folder, manifest, kind, version):
    golden = manifest(kind)
    dt, samples = golden["dt"], 100
    names = golden["inputs"]
    rows = [(k * dt, *golden["commands"][k]) for k in range(samples)]
    inputs = np.array(rows, dtype=[("time", "f8"), *((name, "f8") for name in names)])
    result = fmpy.simulate_fmu(
        str(fmu(folder, kind, version)),
        fmi_type="CoSimulation",
        start_time=0.0,
        stop_time=samples * dt,
        output_interval=dt,
        start_values=golden["parameters"],
        input=inputs,
        output=golden["outputs"],
    )
    rows = np.array([[row[name] for name in golden["outputs"]] for row in result])
    assert difference(rows[1 : samples + 1], golden["expected"][:samples]) < 1e-9


@kinds
@versions
def test_model_exchange_integrates_to_the_same_motion(folder, manifest, kind, version):
    golden = manifest(kind)
    path = str(fmu(folder, kind, version))
    if not golden["model_exchange"]:
        assert fmpy.read_model_description(path).modelExchange is None
        return
    dt, samples = golden["dt"], 50
    names = golden["inputs"]
    # Held commands: each one from its sample to just before the next one.
    rows = []
    for k in range(samples):
        rows.append((k * dt, *golden["commands"][k]))
        rows.append(((k + 1) * dt, *golden["commands"][k]))
    inputs = np.array(rows, dtype=[("time", "f8"), *((name, "f8") for name in names)])
    result = fmpy.simulate_fmu(
        path,
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-8,
        start_time=0.0,
        stop_time=samples * dt,
        output_interval=dt,
        start_values=golden["parameters"],
        input=inputs,
        output=golden["outputs"],
        record_events=False,
    )
    rows = np.array([[row[name] for name in golden["outputs"]] for row in result])[1 : samples + 1]
    expected = np.array(golden["expected"][:samples])
    # Outputs differ by the error of the steps of the model, and the pose by that of the sample time.
    motion = len([name for name in golden["outputs"] if f"start_{name}" in golden["parameters"]])
    pose = 3 if "start_psi" in golden["parameters"] else 0
    outputs = motion - pose
    assert difference(rows[:, :outputs], expected[:, :outputs]) < 1e-3
    if pose:
        assert difference(rows[:, outputs:], expected[:, outputs:]) < 0.02


@versions
def test_directional_derivatives_are_those_of_differences(folder, manifest, version):
    golden = manifest("otter")
    importer = Importer(fmu(folder, "otter", version), version, exchange=True)
    importer.start(golden["parameters"])
    importer.set(dict(zip(golden["inputs"], golden["commands"][0])))
    unknown = importer.references["der_u"]
    for name in golden["inputs"]:
        known = importer.references[name]
        derivative = importer.fmu.getDirectionalDerivative([unknown], [known], [1.0])[0]
        value = importer.get([name])[0]
        slopes = []
        for shift in (-1e-6, 1e-6):
            importer.set({name: value + shift})
            slopes.append(importer.get(["der_u"])[0])
        importer.set({name: value})
        assert abs(derivative - (slopes[1] - slopes[0]) / 2e-6) < 1e-6
    importer.close()


@kinds
def test_names_are_identifiers_and_units_are_kept(folder, manifest, kind):
    description = fmpy.read_model_description(str(fmu(folder, kind, 3)))
    names = [v.name for v in description.modelVariables]
    assert all(name.isidentifier() and name.isascii() for name in names)
    assert len({name.lower() for name in names}) == len(names)
    units = {v.name: v.unit for v in description.modelVariables}
    if kind == "otter":
        assert units["u"] == "m/s" and units["r"] == "rad/s" and units["psi"] == "rad"
        base = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
        assert base["m/s"].m == 1 and base["m/s"].s == -1
