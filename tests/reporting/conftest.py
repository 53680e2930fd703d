import numpy as np
import pytest


@pytest.fixture(scope="session")
def rest():
    """Upper body facing +z with hanging arms, ``(10, 3)`` metres."""
    return np.array(
        [
            [0, 0, 0],  # spine
            [0, 0.5, 0],  # neck
            [0, 0.62, 0.12],  # nose
            [0, 0.8, 0],  # head
            [0.2, 0.45, 0],  # left arm
            [0.25, 0.15, 0],
            [0.25, -0.1, 0.05],
            [-0.2, 0.45, 0],  # right arm
            [-0.25, 0.15, 0],
            [-0.25, -0.1, 0.05],
        ],
        dtype=np.float32,
    )
