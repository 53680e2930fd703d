"""Every reader of files raises what it documents, in bounded time and memory, whatever a file says.

``COSPEECH_FUZZ_MUTATIONS=50000 pytest -m slow tests/fuzz`` tries more than CI's 5,000 inputs of
each reader; ``COSPEECH_FUZZ_SEED=7`` tries others. Failing inputs are kept in the test's folder.
"""

import ast
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.readers import NO_READERS, READERS

MUTATIONS = int(os.environ.get("COSPEECH_FUZZ_MUTATIONS", "5000"))
SEED = int(os.environ.get("COSPEECH_FUZZ_SEED", "1"))
MOST_FAILURES = 5
ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / "src" / "cospeech"

DOORS = {
    *("understood", "read_bytes", "read_json", "parse_json", "read_yaml", "parse_yaml"),
    *("read_weights", "read_checkpoint", "csv.reader", "json.load", "json.loads", "yaml.load"),
    *(
        "yaml.safe_load",
        "np.load",
        "open_array",
        "np.loadtxt",
        "np.memmap",
        "np.fromfile",
        "torch.load",
    ),
    *("zipfile.ZipFile", "mmap.mmap", "soundfile.SoundFile", "soundfile.info", "soundfile.read"),
    *("ElementTree.parse", "ElementTree.fromstring", "XMLParser", "pickle.load", "pickle.loads"),
}
"""Calls that open or take apart what somebody else may have written."""


@pytest.mark.slow
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("name", READERS)
def test_damaged_files_raise_what_is_documented(name, tmp_path):
    failures, tried = [], 0
    workers = [Worker(name, tmp_path / str(k), k) for k in range(2)]
    while any(not worker.done for worker in workers) and len(failures) < MOST_FAILURES:
        for worker in workers:
            if not worker.done:
                failures += worker.collect(MOST_FAILURES - len(failures))
    for worker in workers:
        worker.stop()
        tried += worker.tried
    print(f"{name}: seed {SEED}, {tried} inputs, {len(failures)} failures")
    assert not failures, "\n".join(failures)
    assert tried == MUTATIONS


class Worker:
    """Half of the inputs, in a process that is started again when one of them ends it."""

    def __init__(self, name: str, folder: Path, number: int) -> None:
        self.name, self.folder, self.next = name, folder, number
        self.tried, self.done = 0, False
        folder.mkdir()
        self._start()

    def _start(self) -> None:
        shutil.rmtree(self.folder / "seeds", ignore_errors=True)
        numbers = [str(n) for n in (SEED, self.next, MUTATIONS, 2)]
        command = [sys.executable, "-m", "tests.fuzz.child", self.name, str(self.folder), *numbers]
        self._errors = (self.folder / "stderr.txt").open("w+")
        self._process = subprocess.Popen(
            command,
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )

    def collect(self, most: int) -> list[str]:
        """Failures up to the end of the process, or so many."""
        failures = []
        assert self._process.stdout is not None
        for line in self._process.stdout:
            index, _, told = line.strip().partition(" ")
            if index == "done":
                self.tried = len(range(self.next % 2, MUTATIONS, 2))
                self.done = True
                break
            failures.append(self._named(int(index), told))
            if len(failures) >= most:
                return failures
        code = self._process.wait()
        if not self.done and code:
            failures.append(self._killed(code))
        return failures

    def _killed(self, code: int) -> str:
        index, _, path = (self.folder / "at").read_text().partition(" ")
        if not index.isdigit():
            self.done = True
            return f"{self.name}: its own seeds: {(self.folder / 'stderr.txt').read_text()[-800:]}"
        shutil.copy(path, self.folder / f"failed-{index}-{Path(path).name}")
        self.next = int(index) + 2
        self._start()
        took = "took over 5 s" if code == -signal.SIGPROF else f"ended the process ({code})"
        return self._named(int(index), took)

    def _named(self, index: int, told: str) -> str:
        return f"{self.name}, seed {SEED}, input {index}: {told}; {self.folder}/failed-{index}-*"

    def stop(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()


def test_every_reader_is_in_the_table():
    covered = {name for reader in READERS.values() for name in reader.covers} | NO_READERS.keys()
    found = set(_readers())
    lost = sorted(name for name in found if not any(_below(name, one) for one in covered))
    assert not lost, (
        f"{lost} read files: give each a row in READERS of tests/fuzz/readers.py, or say in"
        " NO_READERS why not"
    )
    gone = sorted(one for one in covered if not any(_below(name, one) for name in found))
    assert not gone, f"tests/fuzz/readers.py names what reads no files: {gone}"


def _below(name: str, package: str) -> bool:
    return f"{name}.".startswith(f"{package}.")


def _readers():
    """Modules that open files or take apart what was in them, and those with a public function
    that is called as readers are."""
    for path in sorted(SOURCES.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        calls = {ast.unparse(n.func) for n in ast.walk(tree) if isinstance(n, ast.Call)}
        names = [n.name for n in tree.body if isinstance(n, ast.FunctionDef)]
        if (
            calls & DOORS
            or any(call.endswith(".read_bytes") for call in calls)
            or any(name.startswith(("read_", "load_", "open_")) for name in names)
        ):
            yield ".".join(path.relative_to(SOURCES).with_suffix("").parts)


def test_the_scan_sees_readers():
    assert {"motion.bvh", "corpus.store", "judges.phase_classifier.frozen"} <= set(_readers())
