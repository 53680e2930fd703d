"""From a schedule to one mask per step of the search."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import ConfigError
from cospeech.matching.control.expressions import Criterion, Mask
from cospeech.matching.control.frames import Closed, common_mask, database_mask
from cospeech.matching.control.schedule import Controls, KeywordControl, SpanControl
from cospeech.matching.search import MatchingSearch
from cospeech.speech.speech import Word

logger = logging.getLogger(__name__)

BEFORE_WORD_S = 0.2
"""How long before its word a keyword begins to count: gestures are ahead of words.

See docs/facts/motion_matching.md, section 5.
"""

_ROUNDING_S = 1e-6


class Fallback(NamedTuple):
    """Steps whose criteria leave no window.

    Attributes:
        start_s: Where the steps begin in the speech, s.
        stop_s: Where they end, s.
        wanted: What should have held.
        done: What was done instead.
    """

    start_s: float
    stop_s: float
    wanted: str
    done: str


@dataclass(frozen=True, eq=False)
class ControlPlan:
    """What controls mean for each step of one search.

    Attributes:
        masks: One ``(M, T)`` mask per step, None where anything may be used; steps with the same
            mask share the array.
        applied: What holds at each step, None where nothing does.
        eligible: ``(steps,)`` windows that may be taken.
        fallbacks: Where something else than asked for is done, in order of time.
    """

    masks: list[Mask | None]
    applied: list[str | None]
    eligible: NDArray[np.int64]
    fallbacks: tuple[Fallback, ...]


def plan_controls(
    controls: Controls,
    search: MatchingSearch,
    steps: int,
    words: Sequence[Word] | None,
    closed: Closed = None,
) -> ControlPlan:
    """Find the windows that every step may use.

    A span holds for the steps whose middle it covers, or, where there is none, for the step of
    which it covers most. A keyword holds for every step that overlaps its word or the
    `BEFORE_WORD_S` before it.

    Args:
        controls: What is wanted.
        search: The database, and the length of a step.
        steps: Steps of the speech.
        words: Of the speech, for keywords; None without a transcript.
        closed: Sequences that aren't used anyway; percentiles are of the others.

    Raises:
        ConfigError: The database lacks what a criterion asks for, or a step is left without windows
            and ``when_empty`` is ``"error"``.
    """
    return _Planning(controls, search, steps, words, closed).plan()


class _Choice(NamedTuple):
    """What holds at a step."""

    mask: Mask | None
    text: str | None


_FREE = _Choice(None, None)


class _Planning:
    def __init__(
        self,
        controls: Controls,
        search: MatchingSearch,
        steps: int,
        words: Sequence[Word] | None,
        closed: Closed,
    ) -> None:
        self.controls, self.search, self.steps, self.words = controls, search, steps, words
        self.step_s = search.step / search.database.spec.fps
        self._closed = closed
        self._open = np.ones(len(search.database), dtype=np.bool_)
        if closed is not None:
            self._open[np.asarray(closed, dtype=np.int64)] = False
        self._counts: dict[int, int] = {}
        self._fallbacks: list[Fallback] = []

    def plan(self) -> ControlPlan:
        by_span = [_FREE] * self.steps
        for step, spans in enumerate(self._spans_by_step()):
            by_span[step] = self._held(step, spans, by_span[step - 1] if step else _FREE)
        chosen = list(by_span)
        for step, keyword in enumerate(self._keywords_by_step()):
            if keyword is not None:
                chosen[step] = self._triggered(step, keyword, by_span[step])
        for fallback in self._fallbacks:
            logger.warning(
                "controls, %.2f to %.2f s: no window that may be used has %s; %s", *fallback
            )
        return ControlPlan(
            [choice.mask for choice in chosen],
            [choice.text for choice in chosen],
            np.array([self._eligible(choice.mask) for choice in chosen], dtype=np.int64),
            tuple(sorted(self._fallbacks)),
        )

    def _held(self, step: int, spans: Sequence[SpanControl], before: _Choice) -> _Choice:
        """What the spans of a step come to."""
        if not spans:
            return _FREE
        choice = self._choice([span.where for span in spans])
        if self._eligible(choice.mask):
            return choice
        wanted, when_empty = str(choice.text), self.controls.when_empty
        if when_empty == "error":
            start_s, stop_s = self._times(step)
            raise ConfigError(
                f"controls, {start_s:.2f} to {stop_s:.2f} s: no window that may be used has"
                f" {wanted}",
                "loosen the criteria, or say when_empty: ignore",
            )
        if when_empty == "previous" and before.mask is not None:
            self._note(step, wanted, f"{before.text} goes on")
            return before
        self._note(step, wanted, "no control")
        return _FREE

    def _triggered(self, step: int, keyword: KeywordControl, by_span: _Choice) -> _Choice:
        choice = self._choice([keyword.where])
        if self._eligible(choice.mask):
            return choice
        done = "no control" if by_span.text is None else f"{by_span.text} as without the keyword"
        self._note(step, str(choice.text), done)
        return by_span

    def _choice(self, criteria: Sequence[Criterion]) -> _Choice:
        distinct = {criterion.text: criterion for criterion in criteria}
        database, step = self.search.database, self.search.step
        masks = [
            database_mask(criterion, database, step, self._closed)
            for criterion in distinct.values()
        ]
        texts = list(distinct)
        text = texts[0] if len(texts) == 1 else " and ".join(f"({text})" for text in texts)
        return _Choice(common_mask(masks, database), text)

    def _eligible(self, mask: Mask | None) -> int:
        key = id(mask)
        if key not in self._counts:
            self._counts[key] = int(self.search.eligible(mask)[self._open].sum())
        return self._counts[key]

    def _spans_by_step(self) -> list[list[SpanControl]]:
        found: list[list[SpanControl]] = [[] for _ in range(self.steps)]
        edges_s = np.arange(self.steps + 1) * self.step_s
        middles_s = (edges_s[:-1] + edges_s[1:]) / 2
        for span in self.controls.spans:
            inside = (middles_s >= span.from_s - _ROUNDING_S) & (
                middles_s < span.to_s - _ROUNDING_S
            )
            covered_s = np.minimum(edges_s[1:], span.to_s) - np.maximum(edges_s[:-1], span.from_s)
            if not inside.any() and (covered_s > _ROUNDING_S).any():
                inside[covered_s.argmax()] = True
            if not inside.any():
                logger.warning(
                    "controls: the speech ends at %.2f s, before %s from %.2f s on",
                    edges_s[-1],
                    span.where.text,
                    span.from_s,
                )
            for step in np.flatnonzero(inside):
                found[step].append(span)
        return found

    def _keywords_by_step(self) -> list[KeywordControl | None]:
        found: list[KeywordControl | None] = [None] * self.steps
        keywords = self.controls.keywords
        if keywords and self.words is None:
            logger.warning(
                "controls: the speech has no transcript, so %s can't be heard in it; give one to"
                " have keywords",
                ", ".join(keyword.word.text for keyword in keywords),
            )
        longest = np.zeros(self.steps)
        starts_s = np.arange(self.steps) * self.step_s
        for keyword in keywords:
            for word in self.words or ():
                if not keyword.word.matches(word.text):
                    continue
                stops_s = np.minimum(starts_s + self.step_s, word.end)
                overlaps_s = stops_s - np.maximum(starts_s, word.start - BEFORE_WORD_S)
                for step in np.flatnonzero(overlaps_s > np.maximum(longest, _ROUNDING_S)):
                    found[step], longest[step] = keyword, overlaps_s[step]
        return found

    def _times(self, step: int) -> tuple[float, float]:
        return step * self.step_s, (step + 1) * self.step_s

    def _note(self, step: int, wanted: str, done: str) -> None:
        """Write down a fallback; one that goes on from the step before becomes longer."""
        start_s, stop_s = self._times(step)
        if self._fallbacks:
            last = self._fallbacks[-1]
            goes_on = abs(last.stop_s - start_s) < _ROUNDING_S
            if goes_on and (last.wanted, last.done) == (wanted, done):
                self._fallbacks[-1] = last._replace(stop_s=stop_s)
                return
        self._fallbacks.append(Fallback(start_s, stop_s, wanted, done))
