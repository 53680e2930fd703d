"""The table of everything that reads files: a new reader is fuzzed when it has a row here."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fuzz import seeds


@dataclass(frozen=True)
class Reader:
    """A reader and the sound files that it is tried with, damaged.

    Attributes:
        read: Given one of the files, the others lying where they were written.
        seeds: Writes the files below a folder; those that are damaged.
        covers: Modules and packages that are tried, below `cospeech`.
    """

    read: Callable[[Path], Any]
    seeds: Callable[[Path], list[Path]]
    covers: tuple[str, ...]


def _weights(path: Path) -> None:
    from cospeech.nn.weights_file import read_weights

    read_weights(path, "train one")


def _checkpoint(path: Path) -> None:
    from cospeech.nn.weights_file import read_checkpoint

    read_checkpoint(path, "train one")


def _encoder(path: Path) -> None:
    from cospeech.metrics.encoder import load_any

    load_any(path)


def _phase_classifier(path: Path) -> None:
    from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier

    FrozenPhaseClassifier.load(path)


def _published_trimodal(path: Path) -> None:
    from cospeech.methods.trimodal import import_published

    import_published(path)


def _published_gesticulator(path: Path) -> None:
    from cospeech.methods.gesticulator.published import read_published

    with seeds.small_gesticulator():
        read_published(path)


def _store(path: Path) -> None:
    from cospeech.corpus.manifest import write_checksums
    from cospeech.corpus.store import Store

    # Checksums refuse nearly everything; whoever means harm writes them, too.
    write_checksums(path.parent)
    store = Store(path.parent)
    store.facts()
    store.describe()
    for recording in range(len(store.recordings)):
        store.annotations(recording)
        store.motion(recording)
    for spans in store.splits.values():
        for span in spans:
            store.speech(span)
            store.upper_body_motion(span)


def _matching_database(path: Path) -> None:
    from cospeech.matching.database import check_database, open_database

    open_database(path.parent)
    check_database(path.parent)


def _pairs(path: Path) -> None:
    from cospeech.methods.motion_matching.refinement.pairs import PairSettings, open_pairs

    open_pairs(path.parent, seeds.PAIRS_MADE_BY, PairSettings(frames=8))


def _journal(path: Path) -> None:
    from cospeech.corpus.build_folder import BuildFolder

    # Of a copy: what is damaged is begun anew.
    copy = Path(shutil.copytree(path.parent, path.parent.with_name("copy"), dirs_exist_ok=True))
    build = BuildFolder(copy, {"schema": 1}, ["a.bin"])
    list(build.take_up())
    build.close()


def _kept_feature(path: Path) -> None:
    from cospeech.corpus.features.acoustics import ENERGY
    from cospeech.corpus.features.keeping import open_kept

    array, facts = (next(path.parent.glob(pattern)) for pattern in ("*.npy", "*.json"))
    open_kept(array, facts, seeds.STRETCHES, ENERGY)


def _product(path: Path) -> None:
    from cospeech.training.products import Products

    Products(str(path.parent)).find("classifier", seeds.PRODUCT_KEY)


def _reference_rows(path: Path) -> None:
    from cospeech.evaluation import read_rows

    read_rows(path)


def _record(path: Path) -> None:
    from cospeech.reporting.collect import collect
    from cospeech.reporting.grouping import group_runs
    from cospeech.reporting.record import read_record

    read_record(path)
    group_runs(collect(path.parent.parent).runs)


def _joint_map(path: Path) -> None:
    from cospeech.motion.joint_map import load_joint_map

    load_joint_map(path)


def _controls(path: Path) -> None:
    from cospeech.matching.control.schedule import read_controls

    for keyword in read_controls(path).keywords:
        keyword.word.matches("enormous" * 4)


def _transcript(path: Path) -> None:
    from cospeech.speech.transcript import read_transcript

    read_transcript(path, 6.0)


def _phases(path: Path) -> None:
    from cospeech.formats.phase_files import read_phases

    read_phases(path)


def _bvh(path: Path) -> None:
    from cospeech.motion.bvh import read_bvh, read_bvh_skeleton

    read_bvh_skeleton(path)
    read_bvh(path)


def _split_list(path: Path) -> None:
    from cospeech.formats.mocap.split_list import read_split_list

    read_split_list(path)


def _offsets(path: Path) -> None:
    from cospeech.formats.trinity_offsets import read_offsets

    read_offsets(path)


def _uci(path: Path) -> None:
    from cospeech.formats.uci_phases import read_uci_recording

    list(read_uci_recording(str(path)))


def _berkeley_2d(path: Path) -> None:
    from cospeech.formats.berkeley.keypoints2d import find_2d_sources

    root = next(folder for folder in path.parents if folder.name == "set")
    for source in find_2d_sources(root):
        list(source.read())


def _berkeley_3d(path: Path) -> None:
    from cospeech.formats.berkeley.extension3d import find_3d_sources

    for source in find_3d_sources(path.parent):
        list(source.read())


def _ted_samples(path: Path) -> None:
    from cospeech.formats.lmdb_values import list_keys
    from cospeech.formats.ted_lmdb import read_samples

    list(read_samples(path.parent, tuple(list_keys(path.parent))))


def _ted(path: Path) -> None:
    from cospeech.formats.lmdb_values import list_keys
    from cospeech.formats.ted_lmdb import read_video

    for key in list_keys(path.parent):
        list(read_video(path.parent, key))


def _vectors(path: Path) -> None:
    from cospeech.speech.word_vectors import load_word_vectors

    load_word_vectors(path, ["<PAD>", "hello", "unheard"], 0)


def _audio(path: Path) -> None:
    from cospeech.speech.audio import load_audio

    load_audio(path)


CONTROLS = """\
controls:
- {to_s: 8, where: left_wrist_speed <= p25}
- {from_s: 8, to_s: 9.5, where: left_wrist_height >= p75 and speed >= 0.5}
- {word: huge|enormous|gigantic}
when_empty: previous
"""

_BERKELEY = ("formats.berkeley", "formats.npz_file")

READERS: dict[str, Reader] = {
    "weights": Reader(_weights, seeds.weights, ("nn.weights_file",)),
    "checkpoint": Reader(_checkpoint, seeds.checkpoints, ("nn.weights_file",)),
    "encoder": Reader(_encoder, seeds.encoders, ("metrics.encoder.files",)),
    "phase classifier": Reader(
        _phase_classifier, seeds.phase_classifiers, ("judges.phase_classifier.frozen",)
    ),
    "published trimodal": Reader(
        _published_trimodal, seeds.published_trimodal, ("methods.trimodal.published",)
    ),
    "published gesticulator": Reader(
        _published_gesticulator,
        seeds.published_gesticulator,
        ("methods.gesticulator.published",),
    ),
    "store": Reader(_store, seeds.stores, ("corpus.manifest", "corpus.store")),
    "journal of a build": Reader(_journal, seeds.journals, ("corpus.build_folder",)),
    "matching database": Reader(
        _matching_database, seeds.matching_databases, ("matching.database",)
    ),
    "pairs": Reader(_pairs, seeds.pairs, ("methods.motion_matching.refinement.pairs",)),
    "kept feature": Reader(_kept_feature, seeds.kept_features, ("corpus.features.keeping",)),
    "product of a stage": Reader(_product, seeds.products, ("training.products",)),
    "reference rows": Reader(
        _reference_rows,
        seeds.texts(a__json='{"noise": {"fgd": 3.1, "mae": null}, "real": {"fgd": 1}}'),
        ("evaluation",),
    ),
    "record": Reader(_record, seeds.records, ("reporting.record",)),
    "joint map": Reader(_joint_map, seeds.joint_maps, ("motion.joint_map",)),
    "controls": Reader(
        _controls,
        seeds.texts(a__yaml=CONTROLS, b__json='[{"word": "(huge|big) ?deal"}]'),
        ("matching.control.schedule",),
    ),
    "transcript": Reader(_transcript, seeds.transcripts, ("speech.transcript",)),
    "phases": Reader(_phases, seeds.phase_files, ("formats.phase_files",)),
    "bvh": Reader(_bvh, seeds.bvh, ("motion.bvh", "motion.bvh_rows")),
    "split list": Reader(
        _split_list,
        seeds.texts(a__csv="id,type\r\n1_wayne_0,train\r\n2_scott_0,test\r\n3_x,additional\r\n"),
        ("formats.mocap.split_list", "formats.tables"),
    ),
    "trinity offsets": Reader(
        _offsets,
        seeds.texts(
            a__csv="take,audio_start,motion_start\n1,0.5,1.25\n2,3,0\n",
            b__csv="Recording_001,90,300,12,24,60,0.5\nRecording_002,30,600,0,0,120,1\n",
        ),
        ("formats.trinity_offsets",),
    ),
    "uci": Reader(_uci, seeds.uci, ("formats.uci_phases", "formats.uci_table")),
    "berkeley keypoints": Reader(_berkeley_2d, seeds.berkeley_tables, _BERKELEY),
    "berkeley samples": Reader(_berkeley_2d, seeds.berkeley_samples, _BERKELEY),
    "berkeley 3-D": Reader(_berkeley_3d, seeds.berkeley_3d, _BERKELEY),
    "ted": Reader(_ted, seeds.ted, ("formats.lmdb_values", "formats.ted_lmdb")),
    "ted samples": Reader(
        _ted_samples, seeds.ted_samples, ("formats.lmdb_values", "formats.ted_lmdb")
    ),
    "word vectors": Reader(
        _vectors, seeds.vectors, ("speech.fasttext_binary", "speech.word_vectors")
    ),
    "audio": Reader(_audio, seeds.audio, ("speech.audio", "speech.audio_streams")),
}

NO_READERS = {
    "foreign": "the door itself",
    "corpus.split_facts": "a store's stream, while it is built",
    "corpus.window_loader": "windows of an open store",
    "corpus.features.streaming": "rows of sound that is in memory",
    "encoders": "opens kept encoders as a reader above does, and what it has just written",
    "experiment.building": "opens checkpoints as a reader above does",
    "experiment.finished_run": "opens records and checkpoints as readers above do",
    "experiment.typed": "the project's own settings",
    "nn.checkpoints": "opens checkpoints as a reader above does",
    "reporting.charts": "what matplotlib has just drawn",
    "doctor.reading": "opens what the readers above open",
    "formats.genea": "opens its table as readers above do",
    "formats.zeggs": "opens its table as readers above do",
    "formats.mocap.reading": "opens what the readers above open",
    "formats.mocap.side_files": "opens what the readers above open",
    "metrics.encoder.packaged": "the package's own file, opened as a reader above does",
    "studies.caused_gestures.strokes": "annotations of an open store",
    "studies.multi_adversary_figures.paper": "the package's own words",
    "methods.motion_matching.refinement.pair_windows": "windows of an open store",
    "methods.trimodal.style": "no file",
    "speech.reading": "opens sound and transcripts as readers above do",
    "speech.espeak": "what a process of ours says",
    "speech.tts": "what a process of ours says",
}
"""What looks like a reader and isn't, or opens files through readers above alone: the reason."""
