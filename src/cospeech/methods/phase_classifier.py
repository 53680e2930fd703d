"""An older name of the command ``python -m cospeech.judges.phase_classifier``."""

import sys

from cospeech.judges.phase_classifier.__main__ import main
from cospeech.terminal import exit_status

if __name__ == "__main__":
    sys.exit(exit_status(main))
