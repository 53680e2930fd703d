"""`prepare.py` as a user meets it: progress, a summary, a report; killed and started again."""

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests import command_line
from tests.fabricated.ted import write_ted

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def databases(tmp_path_factory):
    """Sixty videos, an hour and a half."""
    return write_ted(tmp_path_factory.mktemp("ted"), videos=60, seconds_per_video=100)


@pytest.fixture(scope="module")
def reference(databases, tmp_path_factory):
    outputs = tmp_path_factory.mktemp("reference")
    return outputs, prepare(outputs, databases, "data.workers=1")


def prepare(outputs, root, *overrides):
    return command_line.run(
        outputs, "data=ted", f"data.root={root}", *overrides, script="prepare.py"
    )


def store_bytes(outputs):
    (path,) = [p for p in (outputs / "stores").iterdir() if not p.name.startswith(".")]
    return {file.name: file.read_bytes() for file in path.iterdir() if file.name != "report.html"}


def test_it_says_what_was_kept_and_dropped_and_where_the_report_is(reference):
    _, done = reference
    assert done.returncode == 0, done.stderr
    assert re.search(r"kept: +\d+ recordings of 60 sources, \d+ published windows", done.stdout)
    assert re.search(r"dropped windows: +\d+ pose", done.stdout)
    assert "no window passed the filters" in done.stdout
    report = re.search(r"report: (\S+)", done.stdout)[1]
    assert Path(report).stat().st_size > 20_000
    assert re.search(r"preparing ted.*60/60.*it/s", done.stderr)


def started(outputs, databases, output):
    """A preparation with two readers in the background, in a process group of its own."""
    return subprocess.Popen(
        command_line.arguments(
            outputs, "data=ted", f"data.root={databases}", "data.workers=2", script="prepare.py"
        ),
        cwd=command_line.ROOT,
        env=command_line.environment(),
        stdout=output,
        stderr=output,
        text=True,
        start_new_session=True,
    )


def test_the_bytes_do_not_depend_on_the_number_of_processes(reference, databases, tmp_path):
    done = prepare(tmp_path, databases, "data.workers=3")
    assert done.returncode == 0, done.stderr
    assert store_bytes(tmp_path) == store_bytes(reference[0])


def test_a_killed_preparation_goes_on_to_the_same_bytes(reference, databases, tmp_path):
    process = started(tmp_path, databases, subprocess.DEVNULL)
    deadline = time.monotonic() + 300
    while True:
        journals = list(tmp_path.glob("stores/.*.building/journal.jsonl"))
        done = journals[0].read_bytes().count(b"\n") if journals else 0
        if done >= 5:
            break
        assert process.poll() is None, "it was done before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not list(tmp_path.glob("stores/ted-*")), "something there looks like a store"
    again = prepare(tmp_path, databases, "data.workers=2")
    assert again.returncode == 0, again.stderr
    resumed = re.search(r"going on with .* after (\d+) sources", again.stdout + again.stderr)
    assert int(resumed[1]) >= 5
    assert store_bytes(tmp_path) == store_bytes(reference[0])
    assert not list(tmp_path.glob("stores/.*.building"))


def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(databases, tmp_path):
    process = started(tmp_path, databases, subprocess.PIPE)
    while not [p for p in tmp_path.glob("stores/.*.building/journal.jsonl") if p.stat().st_size]:
        assert process.poll() is None
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 130
    assert "the same command goes on from here" in errors
    assert "Traceback" not in errors


def test_a_damaged_value_is_named_and_the_rest_is_used(databases, tmp_path):
    root = tmp_path / "ted"
    write_ted(root, videos=12, seconds_per_video=20)
    damage(root / "lmdb_train")
    done = prepare(tmp_path, root)
    assert done.returncode == 0, done.stderr
    named = r"not usable: lmdb_train/\S+: .*lmdb_train.*key \d{10}, byte \d+ of the value"
    assert re.search(named, done.stdout)
    strict = prepare(tmp_path, root, "data.strict=true")
    assert strict.returncode == 1
    assert re.search(r"error: .*lmdb_train.*key \d{10}", strict.stderr)


def damage(database):
    """Overwrite the flatbuffer of one value's record batch."""
    path = database / "data.mdb"
    data = bytearray(path.read_bytes())
    # The schema names the column "list"; what is before it are offsets of the schema's tables.
    place = data.index(b"list")
    data[place - 40 : place + 8] = b"\xff" * 48
    path.write_bytes(data)
