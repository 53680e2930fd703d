"""Cospeech: an experiment framework for co-speech gesture generation."""

import os

__version__ = "0.1.0"

# Read when OpenMP is loaded, which is with torch. Without it, idle threads spin while they wait,
# and as soon as anything else wants a core (a second run, a browser) steps take ten times longer.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
