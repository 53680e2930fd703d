"""Cospeech: an experiment framework for co-speech gesture generation."""

import atexit
import os
import shutil
import tempfile
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cospeech.experiment.finished_run import load
    from cospeech.speech.reading import read_speech

__all__ = ["load", "read_speech"]

__version__ = "0.1.0"

# Read when OpenMP is loaded, which is with torch. By default idle threads spin for so long that a
# step takes ten times longer as soon as anything else wants a core (a second run, a browser);
# sleeping at once costs a quarter of the speed of a quiet machine. This many turns cost neither.
os.environ.setdefault("GOMP_SPINCOUNT", "10000")


def _let_numba_cache() -> None:
    """Give numba a folder for this process, where neither the installation nor HOME is writable.

    It refuses to import what it compiles (ours, librosa's) without one.
    """
    sources = [Path(__file__).parent]
    if (librosa := find_spec("librosa")) is not None and librosa.origin is not None:
        sources.append(Path(librosa.origin).parent)
    if "NUMBA_CACHE_DIR" in os.environ or all(os.access(folder, os.W_OK) for folder in sources):
        return
    try:
        caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(caches) / "numba"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return
    except (OSError, RuntimeError):  # not writable, or no home at all
        pass
    with suppress(OSError):
        os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp(prefix="cospeech-numba-")
        atexit.register(shutil.rmtree, os.environ["NUMBA_CACHE_DIR"], ignore_errors=True)


_let_numba_cache()

_ROOMS = {"load": "cospeech.experiment.finished_run", "read_speech": "cospeech.speech.reading"}


def __getattr__(name: str) -> Any:
    """A public name, imported when it is asked for: ``import cospeech`` waits for no library."""
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_ROOMS[name]), name)
