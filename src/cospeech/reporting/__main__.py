"""``python -m cospeech.reporting FOLDER``: the results under a folder, as a table and a page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cospeech.terminal import exit_status, stop_at_once

if __name__ == "__main__":
    stop_at_once()

from cospeech.errors import CospeechError
from cospeech.files import behind_links
from cospeech.reporting.collect import collect
from cospeech.reporting.report import text_report, write_report


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the results table and write ``report.html``; the exit status.

    Args:
        arguments: Command line; that of the process when None.
    """
    parser = argparse.ArgumentParser(
        prog="python -m cospeech.reporting",
        description="Sum up the runs under a folder: a table here, a page with curves and links.",
    )
    parser.add_argument("folder", type=Path, help="outputs/studies/NAME, outputs/runs, or one run")
    parser.add_argument("--markdown", action="store_true", help="print tables as Markdown")
    parser.add_argument("--output", type=Path, help="page to write (FOLDER/report.html)")
    given = parser.parse_args(arguments)
    try:
        collection = collect(given.folder)
        print(text_report(collection, "markdown" if given.markdown else "text"))
        target = behind_links(given.output) if given.output else given.folder / "report.html"
        page = write_report(collection, target)
    except CospeechError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"\npage: {page.resolve()}")
    return 0


if __name__ == "__main__":
    sys.exit(exit_status(main))
