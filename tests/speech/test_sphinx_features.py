"""Sphinx-III cepstra against the recipe written out sample by sample, and by hand."""

import math

import numpy as np
import pytest

from cospeech.speech.feature_sets.sphinx import sphinx_features, sphinx_frames, with_slopes

RATE = 16_000


def noise(samples, seed=0, level=0.1):
    return (level * np.random.default_rng(seed).normal(size=samples)).astype(np.float32)


def written_out(waveform, fps, count):
    """docs/facts/motion_matching.md, section 2, one number at a time."""
    samples = [float(value) * 32767 for value in waveform]
    edges = []
    low, high = (2595 * math.log10(1 + hz / 700) for hz in (133.3333, 6855.4976))
    for i in range(42):
        mel = low + (high - low) * i / 41
        edges.append(round(700 * (10 ** (mel / 2595) - 1) / (RATE / 512)))
    rows, prior = [], 0.0
    for frame in range(count):
        start = round(frame * RATE / fps)
        there = samples[start : start + 409]
        cut = [there[i % len(there)] if there else 0.0 for i in range(409)]
        emphasised = [cut[i] - 0.97 * (cut[i - 1] if i else prior) for i in range(409)]
        prior = cut[-1]
        windowed = [
            value * (0.54 - 0.46 * math.cos(2 * math.pi * i / 408))
            for i, value in enumerate(emphasised)
        ]
        power = np.abs(np.fft.rfft(windowed, 512)) ** 2
        logarithms = []
        for left, centre, right in zip(edges, edges[1:], edges[2:], strict=False):
            height = 2 / ((right - left) * RATE / 512)
            total = 0.0
            for k in range(left, right + 1):
                if k < centre:
                    total += power[k] * height * (k - left) / (centre - left)
                else:
                    total += power[k] * height * (right - k) / (right - centre)
            logarithms.append(math.log(max(total, 1e-5)))
        row = []
        for i in range(13):
            terms = [
                logarithms[k] * math.cos(math.pi * i * (k + 0.5) / 40) * (0.5 if k == 0 else 1)
                for k in range(40)
            ]
            row.append(sum(terms) / 40)
        rows.append([*row, math.log(1 + sum(value**2 for value in cut) / 409)])
    return np.array(rows)


@pytest.mark.parametrize(("fps", "samples"), [(15, 6000), (20, 4001), (60, 3000), (15, 100)])
def test_every_number_by_its_definition(fps, samples):
    waveform = noise(samples)
    waveform[1000:2500] = 0
    count = sphinx_frames(samples, fps) + 1
    features = sphinx_features(waveform, fps, count)
    assert features.shape == (count, 14)
    np.testing.assert_allclose(features, written_out(waveform, fps, count), atol=1e-4)


def test_the_published_lengths():
    # 64 frames of 4.27 s, where the published routine gives 65 and drops the last; so for 192.
    assert sphinx_frames(68_267, 15) == 64
    assert sphinx_frames(204_800, 15) == 192
    assert sphinx_features(noise(68_267), 15).shape == (64, 14)


def test_long_waveforms_are_done_in_blocks_that_do_not_show():
    waveform = noise(RATE * 80)
    whole = sphinx_features(waveform, 15)
    np.testing.assert_array_equal(whole[:1000], sphinx_features(waveform, 15, 1000))
    # A frame depends on the one before it by one sample alone.
    start = round(1023 * RATE / 15)
    later = sphinx_features(waveform[start:], 15, 4)
    np.testing.assert_allclose(whole[1024:1027], later[1:], atol=1e-4)


def test_silence_and_full_scale():
    silent = sphinx_features(np.zeros(RATE, "f4"), 15)
    assert silent[0, 13] == 0
    # Every logarithm is ln 1e-5, and the lowest band counts half.
    np.testing.assert_allclose(silent[:, 0], math.log(1e-5) * 39.5 / 40, rtol=1e-6)
    loud = sphinx_features(np.ones(RATE, "f4"), 15)
    np.testing.assert_allclose(loud[:, 13], math.log(1 + 32767**2), rtol=1e-6)


def test_slopes_are_per_frame():
    ramp = np.outer(np.arange(10), np.arange(1, 15)).astype(np.float32)
    both = with_slopes(ramp)
    assert both.shape == (10, 28)
    np.testing.assert_array_equal(both[:, :14], ramp)
    np.testing.assert_allclose(both[2:-2, 14:27], np.tile(np.arange(1, 14), (6, 1)), rtol=1e-6)
    # At the edge the outermost frame repeats: (1 * (1 - 0) + 2 * (2 - 0)) / 10.
    np.testing.assert_allclose(both[0, 14], 0.5, rtol=1e-6)
    np.testing.assert_allclose(both[:, 27], [14] * 9 + [0])


@pytest.mark.parametrize(("fps", "frames"), [(0, 3), (-1, 3), (15, -1)])
def test_bad_arguments(fps, frames):
    with pytest.raises(ValueError, match=r"fps|frames"):
        sphinx_features(noise(1000), fps, frames)
