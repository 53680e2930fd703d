"""A metric that one line of yaml names stands everywhere, and reads what the method doesn't."""

import importlib
import linecache
import math
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import yaml
from hydra.utils import instantiate

from callbacks.evaluate_fgd import EvaluateFGD
from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.recording import Recording
from cospeech.corpus.splits import Span
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.evaluation import (
    Catalogue,
    EpochEvaluation,
    EvaluationFields,
    evaluate_recordings,
    reference_rows,
    standard_catalogue,
)
from cospeech.evaluation.real_windows import judged_windows
from cospeech.judges.motion_autoencoder import MotionAutoencoder
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.joint_mae import JointMAE
from cospeech.metrics.window_metric import MeanOverWindows
from cospeech.motion.motion import Motion, resample_positions
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.tables import result_table
from cospeech.speech.speech import Word
from tests.corpora import REST_POSE, make_recording, make_store

WINDOW_SAMPLES = round(34 / 15 * 16000)


class Loudness(MeanOverWindows):
    """Mean level of what is said, beside the mean height of what is done."""

    title, unit = "loudness", "full scale"
    needs = frozenset({"audio"})
    compares = "nothing"
    higher_is_better = True

    def mean(self, generated, real):
        assert generated.fields["audio"].shape == (len(generated), WINDOW_SAMPLES)
        return generated.fields["audio"].abs().double().mean()


class Still(torch.nn.Module):
    def generate(self, speech, speaker, generator):
        frames = math.ceil(speech.duration * 15)
        return Motion(UPPER_BODY, 15.0, REST_POSE[None].repeat(frames, axis=0))


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    takes = [make_recording(f"take{i}", seconds=8, seed=i) for i in range(6)]
    return make_store(tmp_path_factory.mktemp("catalogue"), takes)


@pytest.fixture(scope="module")
def encoder(store):
    torch.manual_seed(0)
    return MotionAutoencoder(store.facts()).encoder("untrained")


CATALOGUE = Catalogue(
    {"fgd": FrechetGestureDistance(), "joint_mae": JointMAE(), "loudness": Loudness()}
)


def loudness_of(store, split):
    """The mean over windows on the fixed grid, from the sound itself."""
    levels = []
    for span in store.splits[split]:
        waveform = store.speech(span).waveform
        for first in range(0, span.stop - span.start - 33, 10):
            start = round(first / 15 * 16000)
            levels.append(np.abs(waveform[start : start + WINDOW_SAMPLES]).mean())
    return float(np.mean(levels))


def test_a_metric_of_sound_stands_in_every_row(store, encoder):
    rows = reference_rows(store, encoder, "test", 0, CATALOGUE)
    expected = loudness_of(store, "test")
    assert rows["real_train"]["loudness"] == pytest.approx(loudness_of(store, "train"), rel=1e-3)
    halves = rows.pop("real_halves", None)
    assert halves is None or halves["loudness"] > 0
    for name in rows.keys() - {"real_train"}:
        # motion changes, or comes from another recording; the speech is the row's own
        assert rows[name]["loudness"] == pytest.approx(expected, rel=1e-3), name
    made = evaluate_recordings(Still(), store, "test", encoder, CATALOGUE)
    assert made["loudness"] == pytest.approx(expected, rel=1e-3)


def test_rows_hold_what_means_something_in_them(store, encoder):
    rows = reference_rows(store, encoder, "test", 0, CATALOGUE)
    assert "joint_mae" not in rows["real_train"]  # windows that are no pairs
    assert "fgd" not in rows["mismatched"]  # the same windows, as a set
    for name in rows.keys() - {"real_train", "real_halves", "mismatched"}:
        assert {"fgd", "joint_mae", "loudness", "windows"} <= rows[name].keys()


class OtherSound(MeanOverWindows):
    """How far the sound that motion was made for is from the sound that was recorded with it."""

    title, unit = "other sound", "full scale"
    needs = frozenset({"audio"})
    compares = "pairs"

    def mean(self, generated, real):
        return (generated.fields["audio"] - real.fields["audio"]).abs().double().mean()


def test_mismatched_motion_is_judged_as_if_made_for_the_speech_it_is_beside(store, encoder):
    rows = reference_rows(store, encoder, "test", 0, Catalogue({"other_sound": OtherSound()}))
    assert rows["mismatched"]["other_sound"] == 0


def test_rows_are_kept_for_their_metrics(store, encoder):
    rows = reference_rows(store, encoder, "val", 0, CATALOGUE)
    others = reference_rows(store, encoder, "val", 0, Catalogue({"fgd": FrechetGestureDistance()}))
    assert "loudness" in rows["noise"]
    assert "loudness" not in others["noise"]
    whole = Catalogue({"joint_mae": JointMAE(seed_frames=0)})
    assert whole.digest != Catalogue({"joint_mae": JointMAE()}).digest


def test_an_epoch_has_it(store, encoder):
    windows = WindowDataset(store, "val", WindowSpec(15, 34, 4, 10), frozenset({"positions"}))
    callback = EvaluateFGD(SimpleNamespace(encoder=encoder, catalogue=CATALOGUE))
    fields = EvaluationFields(windows, CATALOGUE.needs)
    evaluation = EpochEvaluation(CATALOGUE, encoder, fields, torch.device("cpu"))
    callback._evaluation = evaluation
    for index in range(len(windows)):
        batch = windows.batch([index])
        callback._update(batch.positions, batch)
    values = evaluation.compute()
    assert values["loudness"].item() == pytest.approx(loudness_of(store, "val"), rel=1e-3)
    assert values["joint_mae"].item() == 0


def test_the_table_has_its_column_with_its_arrow():
    row = {"fgd": 2.0, "fgd_extrapolated": 1.0, "loudness": 0.25, "joint_mae": 0.1}
    record = {
        "model": "m",
        "final": {"windows": row, "recordings": row},
        "references": {"noise": row},
        "metrics": CATALOGUE.described(),
    }
    lines = result_table(record).splitlines()
    heading = lines[0]
    assert "FGD ↓" in heading
    assert "FGD at n → ∞ ↓" in heading
    assert "joint error, m ↓" in heading
    assert "loudness, full scale ↑" in heading
    assert all(line.rstrip().endswith("0.2500") for line in lines[2:5])


def test_what_python_takes_by_default_is_what_the_yaml_names():
    path = Path(__file__).resolve().parents[2] / "conf" / "metrics" / "default.yaml"
    named = instantiate(yaml.safe_load(path.read_text())["catalogue"])
    assert standard_catalogue().digest == Catalogue(named).digest


def test_a_row_asks_no_other_process(store, encoder):
    """Of a distributed run one process makes the rows, when the others may have gone."""

    def asked(*arguments, **options):
        raise AssertionError("another process was asked")

    metric = FrechetGestureDistance()
    metric.distributed_available_fn, metric.dist_sync_fn = (lambda: True), asked
    alone = Catalogue({"fgd": metric})
    assert "fgd" in reference_rows(store, encoder, "val", 3, alone)["noise"]
    with pytest.raises(CospeechError, match="another process was asked"):
        alone.fresh().compute()


def test_what_a_metric_can_not_read_is_not_judged(tmp_path, encoder):
    takes = [make_recording(f"take{i}", seconds=8, seed=i) for i in range(5)]
    takes[1] = replace(takes[1], speech=replace(takes[1].speech, waveform=np.zeros(0, "f4")))
    store = make_store(tmp_path, takes)
    store.splits["test"] = store.splits["train"]
    rows = [
        reference_rows(store, encoder, "test", 0, Catalogue(metrics))["noise"]
        for metrics in ({"joint_mae": JointMAE()}, {"loudness": Loudness()})
    ]
    windows_each = rows[0]["windows"] / len(store.splits["train"])
    assert rows[1]["windows"] == rows[0]["windows"] - windows_each


def test_anything_else_in_the_catalogue_is_refused():
    with pytest.raises(ConfigError, match=r"metrics\.catalogue\.x is a Linear"):
        Catalogue({"x": torch.nn.Linear(1, 1)})


@pytest.mark.parametrize(
    ("declared", "told"),
    [
        ({"title": "two\nlines"}, "no title in one line"),
        ({"title": "\x1b[31mred"}, "no title in one line"),
        ({"title": 101 * "x"}, "no title in one line"),
        ({"title": ""}, "no title in one line"),
        ({"title": ("a", "b")}, "no title in one line"),
        ({"parts": {"slow": 3}}, "no title in one line"),
        ({"unit": None}, "unit that isn't text"),
        ({"higher_is_better": "yes"}, "which is better"),
        ({"compares": "pair"}, "compares 'pair'"),
        ({"needs": "audio"}, "no set of names"),
        ({"needs": {"sound"}}, "needs sound"),
        ({"needs": {"matched"}}, "needs matched"),
    ],
)
def test_what_a_metric_says_of_itself_is_checked(declared, told):
    odd = type("Odd", (Loudness,), declared)()
    with pytest.raises(ConfigError, match=told) as refused:
        Catalogue({"odd": odd})
    assert "metrics.catalogue.odd: Odd" in str(refused.value)


def test_a_metric_without_a_title_is_refused():
    class Untitled(MeanOverWindows):
        pass

    with pytest.raises(ConfigError, match="no title"):
        Catalogue({"untitled": Untitled()})


@pytest.mark.parametrize("name", ["windows", "fgd_low", "interval", "row", "fgd_extrapolated"])
def test_what_rows_hold_beside_metrics_is_no_metrics_name(name):
    with pytest.raises(ConfigError, match="and so has the evaluation"):
        Catalogue({name: Loudness()})


class Two(Loudness):
    title, parts = "quiet and loud", {"loud": "loud"}

    def compute(self):
        return {"value": self.total / self.count, "loud": self.count, "unsaid": -self.count}


def test_values_of_a_metric_are_called_by_its_name_and_have_their_columns(store, encoder):
    catalogue = Catalogue({"two": Two(), "my_fgd": FrechetGestureDistance()})
    row = evaluate_recordings(Still(), store, "val", encoder, catalogue)
    assert row["two"] == pytest.approx(loudness_of(store, "val"), rel=1e-3)
    assert row["two_loud"] == -row["two_unsaid"] == row["windows"]
    assert row["my_fgd"] == row["my_fgd_mean_term"] + row["my_fgd_covariance_term"]
    assert "fgd" not in row
    columns = {column["key"]: column["title"] for column in catalogue.described()}
    assert columns == {
        "two": "quiet and loud, full scale",
        "two_loud": "loud, full scale",
        "my_fgd": "FGD",
    }
    with pytest.raises(ConfigError, match=r"'two_loud', and so has metrics\.catalogue\.two"):
        Catalogue({"two": Two(), "two_loud": Loudness()})


@pytest.mark.parametrize(
    ("computed", "told"),
    [
        (torch.zeros(3), r"odd has the shape \(3,\)"),
        ("much", "fails"),
        ({"low": torch.tensor(1.0)}, "fgd_low is another value's name"),
    ],
)
def test_a_metric_that_fails_is_named(store, encoder, computed, told):
    class Odd(Loudness):
        def compute(self):
            return computed

    name = "fgd" if isinstance(computed, dict) else "odd"
    with pytest.raises(CospeechError, match=told) as refused:
        evaluate_recordings(Still(), store, "val", encoder, Catalogue({name: Odd()}))
    assert f"the metric {name} (Odd) fails in" in str(refused.value)
    assert f"~metrics.catalogue.{name}" in str(refused.value)


def test_a_metric_that_raises_is_named(store, encoder):
    class Raises(Loudness):
        def mean(self, generated, real):
            raise ValueError("boom")

    with pytest.raises(CospeechError, match=r"odd \(Raises\) fails in .*, line \d+: boom"):
        reference_rows(store, encoder, "val", 0, Catalogue({"odd": Raises()}))


def test_a_metric_that_is_no_number_is_told(store, encoder, caplog):
    class Nothing(Loudness):
        def mean(self, generated, real):
            return torch.tensor(float("nan"))

    evaluate_recordings(Still(), store, "val", encoder, Catalogue({"odd": Nothing()}))
    assert "the metric odd is nan" in caplog.text


class Chosen(Loudness):
    def __init__(self, joints=("left_wrist",), threshold=0.1, weights=None):
        super().__init__()
        self.joints, self._threshold, self.weights = joints, threshold, weights


def test_rows_are_made_anew_when_any_setting_of_a_metric_changes():
    settings = [
        {},
        {"joints": ["right_wrist"]},
        {"joints": ["left_wrist", "right_wrist"]},
        {"joints": None},
        {"threshold": 0.2},
        {"weights": torch.ones(2)},
        {"weights": {"a": np.ones(2)}},
        {"weights": {"a": np.zeros(2)}},
        {"weights": {1, 2}},
        {"weights": np.int64(2)},
        {"weights": np.int64(3)},
        {"weights": Path("a")},
        {"weights": Path("b")},
        {"weights": partial(max, 1)},
        {"weights": partial(max, 2)},
        {"weights": np.mean},
        {"weights": np.median},
        {"weights": range(3)},
        {"weights": SimpleNamespace(a=1)},
        {"weights": SimpleNamespace(a=2)},
        {"weights": torch.nn.Linear(1, 1, bias=False).requires_grad_(False)},
        {"weights": torch.nn.MaxPool1d(2)},
        {"weights": torch.nn.MaxPool1d(3)},
    ]
    digests = [Catalogue({"chosen": Chosen(**each)}).digest for each in settings]
    assert len(set(digests)) == len(settings)
    assert digests == [Catalogue({"chosen": Chosen(**each)}).digest for each in settings]


def test_rows_are_made_anew_when_the_code_behind_a_metric_changes(tmp_path, monkeypatch):
    """Its own file, its base's, and one that these take a function from; nobody else's."""
    package = tmp_path / "mine"
    package.mkdir()
    files = {
        "__init__": "",
        "base": "from tests.evaluation.test_catalogue import Loudness\nfrom mine import formulas\n"
        "class Base(Loudness): pass\n",
        "formulas": "def twice(x): return 2 * x\n",
        "metric": "from mine.base import Base\nclass Mine(Base): title = 'mine'\n",
        "other": "X = 1\n",
    }

    def digest(**changed):
        for name, text in {**files, **changed}.items():
            (package / f"{name}.py").write_text(text)
        for name in [name for name in sys.modules if name.partition(".")[0] == "mine"]:
            del sys.modules[name]
        linecache.clearcache()
        importlib.invalidate_caches()
        return Catalogue({"mine": importlib.import_module("mine.metric").Mine()}).digest

    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    before = digest()
    for name in ("base", "formulas", "metric"):
        assert digest(**{name: files[name] + "# changed\n"}) != before, name
    assert digest(other="X = 2\n") == digest() == before


ONSETS = (0.01, 0.3, 0.34, 1.02, 1.98, 2.05, 2.09, 3.31, 4.02, 4.61, 5.93, 6.01, 6.68, 8.4, 9.99)


@pytest.fixture(scope="module")
def spoken(tmp_path_factory):
    """Words that share frames, or reach over the beginnings of windows, and phases, at 60 fps."""
    words = tuple(
        Word(f"word{i}", onset, onset + 0.15 + 0.5 * (i % 3 == 0)) for i, onset in enumerate(ONSETS)
    )
    takes = list[Recording]()
    for i in range(4):
        take = make_recording(f"take{i}", seconds=12, words=words, seed=i)
        frames = resample_positions(take.motion.positions, 15, 60)
        labels = (np.arange(len(frames)) // 19 % 9).astype(np.int8)
        takes.append(replace(take, motion=Motion(UPPER_BODY, 60.0, frames), phases=labels))
    return make_store(tmp_path_factory.mktemp("spoken"), takes)


@pytest.mark.parametrize("begins", [0, 20])
@pytest.mark.parametrize("fps", [15, 20, 25, 10])
def test_an_epoch_reads_of_a_window_what_the_recordings_protocol_reads(
    spoken, encoder, fps, begins, monkeypatch
):
    """Whatever the rate of the method, whose windows of 4 s each hold three of the evaluation."""
    (whole,) = spoken.splits["val"]
    monkeypatch.setitem(spoken.splits, "val", [Span(whole.recording, begins, whole.stop)])
    needs = frozenset({"words", "phases", "word_vectors", "audio", "speakers", "energy"})
    windows = WindowDataset(
        spoken, "val", WindowSpec(fps, 4 * fps, 0, 4 * fps), frozenset({"positions"})
    )
    assert len(windows) >= 2
    found = EvaluationFields(windows, needs).of(torch.arange(len(windows)))
    spans = spoken.splits["val"]
    judged, _ = judged_windows(spoken, "val", spans, encoder, needs)
    alike = [6 * window + within for window in range(len(windows)) for within in range(3)]
    assert found.keys() == needs
    for name, values in judged.fields.items():
        torch.testing.assert_close(found[name], values[alike], rtol=0, atol=0)
    last = EvaluationFields(windows, needs).of(torch.tensor([1]))
    torch.testing.assert_close(last["words"], judged.fields["words"][6:9])


@pytest.mark.parametrize("fps", [15, 20, 25, 10])
def test_every_onset_is_once_in_its_window(spoken, fps):
    windows = WindowDataset(
        spoken, "val", WindowSpec(fps, 4 * fps, 0, 4 * fps), frozenset({"positions"})
    )
    of_words = EvaluationFields(windows, frozenset({"words"})).of(torch.arange(len(windows)))
    for row, first in zip(
        of_words["words"], (0, 10, 20, 60, 70, 80, 120, 130, 140)[: 3 * len(windows)], strict=True
    ):
        expected = {}
        for number, onset in enumerate(ONSETS):
            end = onset + 0.15 + 0.5 * (number % 3 == 0)
            frame = max(0, math.floor(onset * 15) - first)
            if frame < 34 and end > first / 15:
                expected[frame] = number
        frames = row.nonzero().flatten().tolist()
        assert frames == sorted(expected)
        texts = [spoken.vocabulary[row[frame]] for frame in frames]
        assert texts == [f"word{expected[frame]}" for frame in frames]


def test_damaged_weights_are_told_of(store, encoder):
    positions = torch.randn(2, 34, 10, 3)
    windows = WindowDataset(store, "val", WindowSpec(15, 34, 4, 10), frozenset({"positions"}))
    fields = EvaluationFields(windows, frozenset())
    evaluation = EpochEvaluation(standard_catalogue(), encoder, fields, torch.device("cpu"))
    batch = GestureBatch(torch.arange(2), positions=positions)
    with pytest.raises(Exception, match="its weights are damaged"):
        evaluation.update(positions / 0, batch)
