"""Damaged FMUs and states, each in a process of its own: errors of FMI with a message, and no crash."""

import pathlib
import subprocess
import sys

import fmpy
import pytest
from importer import VERSIONS

HERE = pathlib.Path(__file__).parent

INSTANTIATE = """
import sys
sys.path.insert(0, {here!r})
from importer import Importer
try:
    importer = Importer(None, {version}, unpacked={folder!r})
except Exception as error:
    print("refused:", error)
    sys.exit(42)
sys.exit(0)
"""

STATES = """
import random
import sys
sys.path.insert(0, {here!r})
from importer import Importer
importer = Importer({path!r}, {version})
importer.start({{}})
importer.step(0.0, 0.25)
whole = importer.serialize(importer.state())
draw = random.Random(1)
refused = 0
for case in range(400):
    content = bytearray(whole)
    if case % 4 == 0:
        content = content[: draw.randrange(len(content))]
    elif case % 4 == 1:
        content = bytearray(draw.randbytes(draw.randrange(1, 2000)))
    else:
        content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    try:
        importer.deserialize(bytes(content))
    except Exception:
        refused += 1
importer.step(0.25, 0.25)
importer.set_state(importer.deserialize(whole))
importer.step(0.25, 0.25)
print("refused", refused)
sys.exit(0 if refused == 400 else 1)
"""


def python(program, **values):
    program = program.format(here=str(HERE), **values)
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", ["otter", "lstm"])
def test_a_damaged_resource_is_refused_with_a_message(folder, tmp_path, kind, version):
    unpacked = pathlib.Path(fmpy.extract(str(folder / f"{kind}_fmi{version}.fmu"), str(tmp_path / "fmu")))
    model = next((unpacked / "resources").glob("model.*"))
    time = unpacked / "resources" / "sample_time_s.txt"
    whole, text = model.read_bytes(), time.read_bytes()

    def outcome():
        return python(INSTANTIATE, version=version, folder=str(unpacked))

    good = outcome()
    assert good.returncode == 0, good.stdout + good.stderr
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0x40
    for content in (b"", whole[: len(whole) // 3], whole[:-1], bytes(flipped), b"\0garbage\xff" * 99):
        model.write_bytes(content)
        bad = outcome()
        assert bad.returncode == 42, bad.stdout + bad.stderr
        assert "damaged" in bad.stdout and "hydroid export" in bad.stdout, bad.stdout
    model.unlink()
    bad = outcome()
    assert bad.returncode == 42 and "cannot read" in bad.stdout, bad.stdout
    model.mkdir()
    assert outcome().returncode == 42
    model.rmdir()
    model.write_bytes(whole)
    for content in (b"", b"nan", b"-1", b"0.30000001", b"\xff\xfe"):
        time.write_bytes(content)
        bad = outcome()
        assert bad.returncode == 42, bad.stdout + bad.stderr
    time.write_bytes(text)
    assert outcome().returncode == 0


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", ["tug", "committee", "gru_feedback", "hostile"])
def test_damaged_states_are_refused(folder, kind, version):
    done = python(STATES, path=str(folder / f"{kind}_fmi{version}.fmu"), version=version)
    assert done.returncode == 0, done.stdout + done.stderr
