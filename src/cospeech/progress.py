"""Progress bars that behave in a terminal and in a log file."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterable
from typing import TypeVar

from tqdm import tqdm

Item = TypeVar("Item")


def progress_bar(
    items: Iterable[Item], total: int | None, title: str, done: int = 0
) -> Generator[Item]:
    """The items, with a bar that shows rate and estimate.

    Args:
        items: What to go through.
        total: How many there are, if known.
        title: What is being done.
        done: How many of the total were done before.
    """
    # A log file gets a line every ten seconds instead of one per refresh.
    interval = 0.1 if sys.stderr.isatty() else 10.0
    yield from tqdm(
        items, total=total, desc=title, initial=done, mininterval=interval, dynamic_ncols=True
    )
