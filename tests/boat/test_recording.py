"""Recordings of `hydroid live`, read by the library mcap and by hydroid."""

import subprocess
import time

from conftest import COMMAND
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def recording(hydroid):
    """The file that is being written."""
    state = hydroid.wait(lambda s: s["recording"] and s["motion"] and s["recording"]["seconds"] > 8.0, 60, "a recording")
    return hydroid.folder / state["recording"]["path"]


def rows(path, topic):
    """Messages of a topic with the time of the sender."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [(m.publish_time, decoded) for _, _, m, decoded in reader.iter_decoded_messages(topics=[topic])]


def test_a_complete_recording_has_what_was_sent(sea):
    boat, hydroid = sea("new", scale=4.0)
    path = recording(hydroid)
    assert hydroid.stop() == 130
    attitudes = rows(path, "ATTITUDE")
    assert len(attitudes) > 100
    assert all(later > earlier for (earlier, _), (later, _) in zip(attitudes, attitudes[1:]))
    fixes = [fix for _, fix in rows(path, "GPS_RAW_INT")]
    assert all(63.0 < fix.lat < 64.0 and 10.0 < fix.lon < 11.0 for fix in fixes), "degrees"
    assert any("recording" in event.data for _, event in rows(path, "/events"))


def test_after_a_kill_all_but_the_last_second_can_be_read(sea):
    boat, hydroid = sea("new")
    path = recording(hydroid)
    hydroid.process.kill()
    hydroid.process.wait()
    done = subprocess.run([COMMAND, "inspect", str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    line = next(line for line in done.stdout.splitlines() if line.startswith("ATTITUDE "))
    seconds = float(line.split("duration ")[1].split(" s")[0])
    assert seconds > 6.0, line


def test_a_folder_that_cannot_be_written_is_told_and_the_session_goes_on(sea):
    boat, hydroid = sea("new", "-o", "/proc/nothing")
    hydroid.wait(lambda s: s["motion"], 30, "a motion")
    time.sleep(1.0)
    assert hydroid.state["recording"] is None
    assert any("cannot be written" in said["text"] and said["level"] == "error" for said in hydroid.said)
    assert hydroid.act("record")[0] == 409
