"""fastText binary models as its saveModel writes them, of any size, and damaged ones."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

BUCKETS, SHORTEST, LONGEST = 50, 3, 6


def write_fasttext_model(
    path: Path, matrix: np.ndarray, words: list[str], **changes: object
) -> Path:
    """Settings, dictionary, input matrix (a row per word, then per bucket) and output matrix.

    ``changes`` overwrite single fields of the header, to break it.
    """
    fields = {
        "magic": 793712314, "version": 12, "dimensions": matrix.shape[1], "kind": 2,
        "buckets": BUCKETS, "shortest": SHORTEST, "longest": LONGEST, "pruned": -1,
        "quantised": 0, "size": len(words), "labels": [], "height": matrix.shape[0],
    } | changes  # fmt: skip
    with path.open("wb") as file:
        file.write(struct.pack("<ii", fields["magic"], fields["version"]))
        # dim, ws, epoch, minCount, neg, wordNgrams, loss, model, bucket, minn, maxn, lrUpdateRate
        file.write(struct.pack(
            "<12i", fields["dimensions"], 5, 5, 1, 5, 1, 2, fields["kind"],
            fields["buckets"], fields["shortest"], fields["longest"], 100,
        ))  # fmt: skip
        file.write(struct.pack("<d", 1e-4))
        labels = fields["labels"]
        file.write(struct.pack("<3i", fields["size"] + len(labels), fields["size"], len(labels)))
        file.write(struct.pack("<2q", 1000, fields["pruned"]))
        for kind, entries in enumerate((words, labels)):
            for word in entries:
                file.write(word.encode() + b"\0" + struct.pack("<qb", 10, kind))
        file.write(struct.pack("<b", fields["quantised"]))
        file.write(struct.pack("<2q", fields["height"], matrix.shape[1]))
        file.write(matrix.astype("<f4").tobytes())
        output = np.zeros((len(words), matrix.shape[1]), dtype="<f4")
        file.write(struct.pack("<b2q", 0, *output.shape) + output.tobytes())
    return path


def write_random_model(path: Path, words: list[str], dimensions: int = 300, seed: int = 0) -> Path:
    """A model of these words whose rows are drawn from N(0, 1)."""
    shape = (len(words) + BUCKETS, dimensions)
    matrix = np.random.default_rng(seed).standard_normal(shape)
    return write_fasttext_model(path, matrix, words)
