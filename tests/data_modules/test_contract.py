"""What every corpus of ``conf/data`` must do, on a small fabricated download.

A new yaml is covered by being there: it fails until `tests.fabricated.downloads` writes one for it.
"""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

import cospeech.experiment  # noqa: F401  registers the resolver of run folders
from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.features import fields_of
from cospeech.corpus.recording import Recording
from cospeech.corpus.splits import SPLITS
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import ConfigError
from cospeech.motion.skeleton import Skeleton
from tests.fabricated.downloads import DOWNLOADS

CONF = Path(__file__).resolve().parents[2] / "conf"
ON_DISK = sorted({path.stem for path in (CONF / "data").glob("*.yaml")} - {"base"})
CORPORA = [
    pytest.param((name, writer), id=writer.__name__[1:] if writer else name)
    for name in ON_DISK
    for writer in DOWNLOADS.get(name, (None,))
]
SMALL = {"synthetic": {"minutes": 1, "speakers": 2}}


class Reader:
    """What reads windows, as a method does."""

    window = WindowSpec(15.0, 34, 4, 10)

    def __init__(self, *needs: str) -> None:
        self.needs = frozenset(needs)


class StepReader(Reader):
    """As a method does that works at another rate."""

    window = WindowSpec(20.0, 20, 0, 20, interleaved=True)


READERS = (
    Reader("positions", "audio", "words", "speakers"),
    Reader("audio", "words"),
    StepReader("wrists", "phases", "speakers"),
    StepReader("rotations", "root", "energy"),
)


class Corpus:
    """A fabricated download and the data modules that read it."""

    def __init__(self, name: str, root: Path, stores: Path) -> None:
        self.stores = stores
        self.changes = {"store_dir": str(stores), "batch_size": 2, "workers": 1}
        self.changes |= SMALL.get(name, {"root": str(root)})
        with initialize_config_dir(str(CONF), version_base="1.3"):
            self.config = compose("train", ["model=trimodal", f"data={name}"]).data

    def module(self, **changes):
        """A new module, as ``python train.py data=NAME data.root=ROOT ...`` makes it."""
        return instantiate(self.config, **self.changes, **changes)


@pytest.fixture(scope="module", params=CORPORA)
def corpus(request, tmp_path_factory):
    name, write = request.param
    if write is None:
        pytest.fail(f"conf/data/{name}.yaml has no download in tests/fabricated/downloads.py")
    folder = tmp_path_factory.mktemp(name)
    write(folder / "raw")
    return Corpus(name, folder / "raw", folder / "stores")


@pytest.fixture(scope="module")
def ids(corpus):
    """Recordings in the order of the sources, as they are read into the store below."""
    module, read = corpus.module(), {}
    order = [source.id for source in module.sources]

    def watched(source):
        items = list(source.read())
        read[source.id] = [item.id for item in items if isinstance(item, Recording)]
        return items

    module.__dict__["sources"] = [
        replace(source, read=partial(watched, source)) for source in module.sources
    ]
    module.prepare_store()
    return [recording for source in order for recording in read[source]]


@pytest.fixture(scope="module")
def store(corpus, ids):
    return corpus.module().prepare_store()


def test_prepared_again_is_the_same_store_and_nothing_is_read(corpus, store, monkeypatch):
    again = corpus.module()
    monkeypatch.setattr(again, "_build", lambda *_: pytest.fail("the store is built again"))
    assert again.prepare_store().path == store.path
    assert again.prepare_store().fingerprint == store.fingerprint
    assert [path for path in corpus.stores.iterdir() if path.is_dir()] == [store.path]
    parameters = again.store_parameters()
    assert json.loads(json.dumps(parameters)) == parameters
    assert corpus.module(split_seed=1).store_parameters() != parameters


def test_recordings_are_those_of_the_sources_in_their_order(store, ids):
    assert [recording.id for recording in store.recordings] == ids


def test_splits_have_something_and_share_no_frame_with_training(store):
    frames = {
        split: {
            (span.recording, frame)
            for span in store.splits[split]
            for frame in range(span.start, span.stop)
        }
        for split in SPLITS
    }
    assert all(frames.values())
    assert not frames["train"] & (frames["val"] | frames["test"])
    # Some published splits have no test part: what validates tests, too.
    assert frames["val"] == frames["test"] or not frames["val"] & frames["test"]


def test_people_look_like_people(corpus, store):
    """Axes: the head is up, the left arm at +x, the nose in front; metres."""
    assert store.has_upper_body == corpus.module().upper_body
    if store.has_upper_body:
        upper = np.concatenate([store.upper_body(i) for i in range(len(store.recordings))])
        spine, neck, nose, head, left_shoulder, _, _, right_shoulder, _, _ = upper.mean(axis=0)
        assert 0.15 < neck[1] - spine[1] < 0.45
        assert head[1] > neck[1]
        assert left_shoulder[0] > 0.08
        assert right_shoulder[0] < -0.08
        assert nose[2] > neck[2]


def can_fill(store, needs: frozenset[str]) -> bool:
    columns = store.recordings.columns
    has = {
        "upper body": store.has_upper_body,
        "motion": store.dimensions == 3,
        "sound": any(columns["has_audio"]),
        "phases": any(columns["has_phases"]),
        "rotations": any(columns["has_rotations"]),
    }
    return all(has.get(field.reads, True) for field in fields_of(needs))


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: "-".join(sorted(reader.needs)))
def test_batches_have_the_fields_that_were_asked_for(corpus, store, reader):
    module = corpus.module()
    module.attach(reader)
    if not can_fill(store, reader.needs):
        with pytest.raises(ConfigError, match=rf"{module.corpus_name}\b.* (none|no recording)"):
            module.dataset("train")
        return
    module.refuse_impossible("trimodal", reader.needs)
    for split in SPLITS:
        windows = module.dataset(split)
        batch = windows.batch(range(min(2, len(windows))))
        filled = {**batch.fields, "window_ids": batch.window_ids}
        assert set(filled) == reader.needs | {"window_ids"}
        for name, value in filled.items():
            assert len(value) == len(batch)
            assert value.isfinite().all()
            if name in ("positions", "joints", "words", "phases"):
                assert value.shape[1] == reader.window.frames
        if "audio" in filled:
            assert batch.audio.shape[1] == reader.window.audio_samples
            assert batch.audio.abs().max() <= 1


def test_what_judges_read_is_in_what_is_judged_alone(corpus, store):
    if not store.has_upper_body:
        return
    module = corpus.module()
    module.attach(StepReader("root"), frozenset({"positions"}))
    fields = {split: set(module.dataset(split).batch([0]).fields) for split in SPLITS}
    assert fields["train"] == {"root"}
    assert fields["val"] == fields["test"] == {"root", "positions"}


def test_what_can_not_be_filled_is_refused_before_anything_is_prepared(corpus, tmp_path):
    module = corpus.module()
    module.store_dir = str(tmp_path)
    needs = frozenset({"positions", "audio"})
    if module.upper_body:
        module.refuse_impossible("trimodal", needs)
    else:
        with pytest.raises(ConfigError, match=rf"trimodal needs .*{module.corpus_name} has none"):
            module.refuse_impossible("trimodal", needs)
    assert list(tmp_path.iterdir()) == []


def test_windows_lie_in_the_order_of_spans_and_an_epoch_goes_on_where_it_stopped(corpus, store):
    reader = next(reader for reader in READERS if can_fill(store, reader.needs))

    def attached(**changes):
        module = corpus.module(**changes)
        module.attach(reader)
        return module

    def order(batches) -> list[int]:
        return [int(window) for batch in batches for window in batch.window_ids]

    windows = attached().dataset("val")
    places = [windows.describe(i) for i in range(len(windows))]
    assert [place["window"] for place in places] == list(range(len(windows)))
    spans = [store.recordings[span.recording].id for span in store.splits["val"]]
    visited = [spans.index(place["recording"]) for place in places]
    assert visited == sorted(visited)

    whole = order(attached().train_dataloader())
    assert len(whole) >= 2
    assert len(set(whole)) == len(whole)
    stopped, resumed = attached().train_dataloader(), attached().train_dataloader()
    begun = order([next(iter(stopped))])
    resumed.load_state_dict(stopped.state_dict())
    assert begun + order(resumed) == whole
    assert order(attached(seed=1).train_dataloader()) != whole


def test_facts_are_complete_plain_values(store):
    facts = store.facts()
    assert set(facts) == set(CorpusFacts.__annotations__)
    assert json.loads(json.dumps(facts)) == facts
    assert facts["words"][:4] == ["<PAD>", "<SOS>", "<EOS>", "<UNK>"]
    training = {store.recordings[span.recording].speaker for span in store.splits["train"]}
    assert set(facts["speakers"]) == training
    assert len(Skeleton.from_dict(facts["skeleton"]).joints) == store.motion(0).positions.shape[1]
    assert facts["fingerprint"] == store.fingerprint
    assert Path(facts["store"]) == store.path
    statistics = (facts["mean_direction"], facts["bone_lengths"])
    assert [len(values) for values in statistics] == ([27, 9] if store.has_upper_body else [0, 0])
