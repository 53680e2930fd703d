"""What a reader finds in a corpus: sources, each opened when its turn comes."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from cospeech.corpus.recording import Recording
from cospeech.errors import CospeechError


@dataclass(frozen=True)
class Dropped:
    """Something of a source that was left out, and why.

    Attributes:
        id: The recording it would have been.
        reason: A sentence for the person who owns the data: what was wrong, where.
        kind: The reason in a word or two, the same for all of its kind, for counting.
        is_fault: The data is damaged or doesn't fit, rather than left out by a rule of the corpus;
            such a thing stops the preparation where the user wants it strict.
        windows: Filter -> number of candidate windows that it left out here.
        words: What was said here, for published vocabularies count it all the same.
        trace: Where in the code an unexpected error came from, for the log.
    """

    id: str
    reason: str
    kind: str
    is_fault: bool = False
    windows: dict[str, int] = field(default_factory=dict)
    words: tuple[str, ...] = ()
    trace: str = ""

    @classmethod
    def fault(
        cls, name: str, error: Exception, kind: str = "unreadable", words: tuple[str, ...] = ()
    ) -> Dropped:
        """What an error costs.

        Args:
            name: The recording, or the source, that it costs.
            error: Any error that came up while it was read.
            kind: For counting.
            words: What was said there.
        """
        lines = traceback.format_exception(error)
        expected = isinstance(error, CospeechError) and error.__cause__ is None
        told = explained(error)
        return cls(
            name, str(told), kind, True, words=words, trace="" if expected else "".join(lines)
        )


def explained(error: Exception) -> CospeechError:
    """An error as one for the person who owns the data: an unexpected one says what and where."""
    if isinstance(error, CospeechError):
        return error
    frames = traceback.extract_tb(error.__traceback__)
    package = Path(__file__).parents[1]
    ours = [frame for frame in frames if Path(frame.filename).is_relative_to(package)] or frames
    place = f" ({Path(ours[-1].filename).name}, line {ours[-1].lineno})" if ours else ""
    reason = str(error).strip().split("\n", 1)[0][:200]
    return CospeechError(
        f"unexpected {type(error).__name__}{f': {reason}' if reason else ''}{place}",
        "the command's log has the traceback; if the files are sound, please report it",
    )


@dataclass(frozen=True)
class Source:
    """A file, a group of files or a database value that yields recordings when read.

    Attributes:
        id: Unique in the corpus.
        read: Opens it and yields its recordings, in a fixed order. Called in another process where
            the corpus is prepared in parallel, so it is a `functools.partial` of a module's
            function with plain arguments.
        files: Every file it reads; their names, sizes and times make the corpus's fingerprint.
    """

    id: str
    read: Callable[[], Iterable[Recording | Dropped]]
    files: tuple[Path, ...]


def existing_folder(root: str | Path) -> Path:
    """The folder that ``data.root`` names.

    Raises:
        CospeechError: It is absent, or no folder.
    """
    if not Path(root).is_dir():
        raise CospeechError(f"{root} is not a folder", hint="check the path (data.root)")
    return Path(root)
