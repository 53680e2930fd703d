"""Cospeech: an experiment framework for co-speech gesture generation."""

import os

__version__ = "0.1.0"

# Read when OpenMP is loaded, which is with torch. By default idle threads spin for so long that a
# step takes ten times longer as soon as anything else wants a core (a second run, a browser);
# sleeping at once costs a quarter of the speed of a quiet machine. This many turns cost neither.
os.environ.setdefault("GOMP_SPINCOUNT", "10000")
