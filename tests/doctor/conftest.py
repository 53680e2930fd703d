"""Clean recordings, made once."""

import pytest

from cospeech.corpus.recording import Recording


@pytest.fixture(scope="session")
def takes() -> list[Recording]:
    """Six takes of 20 s of six speakers."""
    pytest.importorskip("espeakng_loader")
    from tests.doctor.planted import make_takes

    return make_takes(6, minutes=2)


@pytest.fixture(scope="session")
def long_take() -> Recording:
    """A take of about 75 s."""
    pytest.importorskip("espeakng_loader")
    from tests.doctor.planted import make_takes

    return make_takes(1, minutes=60)[0]
