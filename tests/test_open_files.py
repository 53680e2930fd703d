"""Whatever lies in a user's folder, no reader waits for a pipe or reads a device without end."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
READERS = re.compile(
    r"open|.*\.(open|read_bytes|read_text)|np\.(load|memmap|fromfile|loadtxt|genfromtxt)"
    r"|(torch|OmegaConf)\.load|(io\.)?FileIO|(zipfile\.)?ZipFile|soundfile\.(info|read|SoundFile)|_Forward"
)

GUARDED = {
    "corpus/build_folder.py": "a folder that this process makes and locks",
    "corpus/manifest.py": "has just been written",
    "corpus/split_facts.py": "has just been written",
    "corpus/store.py": "asks whether it is a file first",
    "experiment/help.py": "the project's own settings",
    "experiment/typed.py": "the project's own settings, and files of --config-dir by Hydra's rules",
    "files.py": "has just been written",
    "foreign.py": "the door itself",
    "formats/berkeley/audio.py": "asks require_no_pipe first",
    "formats/npz_file.py": "the archive comes from open_file",
    "methods/base.py": "opens a stream of motion",
    "motion/bvh_rows.py": "bytes in memory",
    "motion/joint_map.py": "the package's own maps",
    "nn/weights_file.py": "asks whether it is a file first",
    "reporting/charts.py": "the package's own style",
    "reporting/markup.py": "the package's own style",
    "reporting/player/page.py": "the package's own style and script",
    "reporting/run_state.py": "opens without waiting, and reads nothing",
    "studies/multi_adversary_figures/paper.py": "the package's own words",
    "speech/audio.py": "asks whether it is a file first",
    "speech/audio_streams.py": "its callers ask whether it is a file",
    "speech/fasttext_binary.py": "open_file has opened it",
    "speech/word_vectors.py": "a class's own method, behind open_file",
}
"""Files that read by other means than `cospeech.foreign`, and why none of them can hang."""


def test_files_are_read_through_the_door():
    sources = [*(ROOT / "src" / "cospeech").rglob("*.py"), *(ROOT / "data_modules").rglob("*.py")]
    sources += [*(ROOT / "callbacks").glob("*.py"), *ROOT.glob("*.py")]
    found = {
        str(path.relative_to(ROOT)).removeprefix("src/cospeech/")
        for path in sources
        if any(map(reads, ast.walk(ast.parse(path.read_text(encoding="utf-8")))))
    }
    assert found - set(GUARDED) == set(), "read it with cospeech.foreign's open_file or read_bytes"
    assert set(GUARDED) - found == set(), "has nothing to excuse"


def reads(node):
    if not isinstance(node, ast.Call):
        return False
    name = ast.unparse(node.func)
    mode = [one.value for one in node.args if isinstance(one, ast.Constant)]
    writes = name.endswith("open") and any(isinstance(one, str) and one[0] in "wax" for one in mode)
    return READERS.fullmatch(name) is not None and not writes
