"""Fixtures that every test may use."""

import signal
from pathlib import Path

import pytest
import torch
from hypothesis import settings

# Tests run side by side on few cores: threads that wait for one another would cost more than they
# bring, and sums must not depend on how they are split.
torch.set_num_threads(1)

# How long an example takes says something about the machine, not about the code.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

# In the background of a script pytest is started with Ctrl-C ignored, and so would be the commands
# that tests start and stop.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """Let what a test printed be sent to another process.

    Hostile names contain halves of characters; a worker of xdist that has to encode one dies.
    """
    report = yield
    report.sections = [
        (title, printed.encode("utf-8", "backslashreplace").decode("utf-8"))
        for title, printed in report.sections
    ]
    return report


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of reference data beside the checkout; the test skips where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("reference data (../shared) is not beside this checkout")
    return SHARED
