"""Time of the Fréchet gesture distance over a validation set of the paper's size.

Prints a table and, as the last line, the same numbers as JSON. Run: python benchmarks/fgd.py
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable

import numpy as np
import scipy
import scipy.linalg
import torch

from cospeech.metrics.encoder import GestureEncoder, PoseAutoencoder
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.functional import frechet_distance, kernel_distance
from cospeech.metrics.moments import recording_moments
from cospeech.metrics.uncertainty import fgd_interval


def median_seconds(function: Callable[[], object], repeats: int) -> float:
    """Median wall time of calls, after one that is not counted."""
    function()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def scipy_frechet(
    mean_a: np.ndarray, cov_a: np.ndarray, mean_b: np.ndarray, cov_b: np.ndarray
) -> float:
    """The usual way, with a general matrix root."""
    root = scipy.linalg.sqrtm(cov_a @ cov_b).real
    return float(((mean_a - mean_b) ** 2).sum() + np.trace(cov_a + cov_b - 2 * root))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--windows", type=int, default=26_752, help="windows on each side")
    parser.add_argument("--batch", type=int, default=128)
    parser.add_argument("--recordings", type=int, default=100)
    parser.add_argument("--device", default="cpu")
    arguments = parser.parse_args()

    torch.manual_seed(0)
    encoder = GestureEncoder(PoseAutoencoder(), [0.0] * 27).to(arguments.device)
    metric = FrechetGestureDistance().to(arguments.device)
    batch = torch.randn(arguments.batch, 34, 10, 3, device=arguments.device)
    batches = arguments.windows // arguments.batch

    def whole_set() -> float:
        metric.reset()
        for _ in range(batches):
            sides = [
                EvaluationWindows(moved, encoder.encode_positions(moved))
                for moved in (batch, batch + 0.1)
            ]
            metric.update(*sides)
        return metric.compute()["value"].item()

    features = torch.randn(2, arguments.windows, 32, dtype=torch.float64)
    moments = [value.numpy() for side in features for value in (side.mean(0), torch.cov(side.T))]
    tensors = [torch.from_numpy(value) for value in moments]
    ids = [window % arguments.recordings for window in range(arguments.windows)]
    real, generated = (recording_moments(side, ids) for side in features)

    seconds = {
        f"update and compute, 2 x {batches * arguments.batch} windows": median_seconds(
            whole_set, 3
        ),
        "Fréchet distance in 32 dimensions": median_seconds(lambda: frechet_distance(*tensors), 50),
        "the same by scipy.linalg.sqrtm": median_seconds(lambda: scipy_frechet(*moments), 50),
        f"kernel distance, 2 x {arguments.windows} features": median_seconds(
            lambda: kernel_distance(*features), 3
        ),
        f"interval, {arguments.recordings} recordings, 400 resamples": median_seconds(
            lambda: fgd_interval(real, generated), 3
        ),
    }
    difference = abs(frechet_distance(*tensors).item() - scipy_frechet(*moments))
    for name, value in seconds.items():
        print(f"{name:<50} {value * 1000:12.2f} ms")
    print(f"{'difference between the two distances':<50} {difference:12.1e}")
    print(
        json.dumps(
            {
                "benchmark": "fgd",
                "device": arguments.device,
                "threads": torch.get_num_threads(),
                "torch": torch.__version__,
                "scipy": scipy.__version__,
                "seconds": seconds,
                "difference": difference,
            }
        )
    )


if __name__ == "__main__":
    main()
