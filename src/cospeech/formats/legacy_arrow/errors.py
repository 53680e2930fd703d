"""The one error of this reader."""

from __future__ import annotations

from cospeech.errors import CospeechError

HINT_REBUILD = (
    "read it with the release that wrote it, and write it again with pyarrow 0.13 to 11.0"
)


class LegacyArrowError(CospeechError):
    """A value is damaged, was written by a release that isn't read, or holds what isn't unpickled.

    Args:
        problem: What is wrong, in one sentence.
        offset: Where it shows, in bytes from the start of the value.
        hint: The next step, where there is one.

    Attributes:
        offset: As given.
    """

    def __init__(self, problem: str, offset: int, hint: str | None = None) -> None:
        self.offset = offset
        super().__init__(f"byte {offset}: {problem}", hint)
        self.problem = problem

    def moved_by(self, distance: int) -> LegacyArrowError:
        """The same error, its offset counted from `distance` bytes earlier."""
        return LegacyArrowError(self.problem, self.offset + distance, self.hint)

    def __reduce__(self) -> tuple[type, tuple[str, int, str | None]]:
        return type(self), (self.problem, self.offset, self.hint)
