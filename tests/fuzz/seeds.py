"""Sound files of every kind that a reader takes, small, for `tests.fuzz.readers`.

Each function writes them below a folder and returns those that are to be damaged.
"""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import soundfile

from tests.fabricated.mocap import google_json, spoken, textgrid, tsv

WORDS = spoken("fuzz", 6.0)


def texts(**contents: str):
    """Seeds that are these texts, ``name_suffix="..."`` in the file ``name.suffix``."""

    def write(folder: Path) -> list[Path]:
        paths = []
        for name, text in contents.items():
            stem, _, suffix = name.rpartition("__")
            path = folder / f"{stem}.{suffix}"
            path.write_text(text, encoding="utf-8", newline="")
            paths.append(path)
        return paths

    return write


def weights(folder: Path) -> list[Path]:
    import torch

    content = {
        "state": {"a": torch.ones(3, 4), "b": torch.arange(5)},
        "name": "x",
        "list": [1, 2.5],
    }
    for name, zipped in (("new.pt", True), ("old.pt", False)):
        torch.save(content, folder / name, _use_new_zipfile_serialization=zipped)
    return [folder / "new.pt", folder / "old.pt"]


def checkpoints(folder: Path) -> list[Path]:
    import torch

    network = torch.nn.Linear(2, 3)
    optimizer = torch.optim.Adam(network.parameters())
    network(torch.ones(1, 2)).sum().backward()
    optimizer.step()
    content = {
        "epoch": 3,
        "global_step": 40,
        "pytorch-lightning_version": "2.6.0",
        "state_dict": network.state_dict(),
        "optimizer_states": [optimizer.state_dict()],
        "hyper_parameters": {"hidden_size": 3, "names": ["ada", "ben"]},
        "callbacks": {"ModelCheckpoint{}": {"best_model_score": torch.tensor(1.5), "path": "a/b"}},
    }
    torch.save(content, folder / "last.ckpt")
    return [folder / "last.ckpt"]


def encoders(folder: Path) -> list[Path]:
    import argparse

    import torch

    from cospeech.metrics.encoder import GestureEncoder, save_encoder
    from cospeech.metrics.encoder.network import PoseAutoencoder

    torch.manual_seed(0)
    network = PoseAutoencoder(34, 64)
    save_encoder(GestureEncoder(network, [0.0] * 27), folder / "ours.pt")
    arguments = argparse.Namespace(mean_dir_vec=[[0.1] * 27], n_poses=34)
    for name, zipped in (("published.bin", True), ("old.bin", False)):
        content = {"args": arguments, "epoch": 1, "gen_dict": network.state_dict(), "pose_dim": 27}
        torch.save(content, folder / name, _use_new_zipfile_serialization=zipped)
    return [folder / "ours.pt", folder / "published.bin", folder / "old.bin"]


def phase_classifiers(folder: Path) -> list[Path]:
    import torch

    from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
    from cospeech.judges.phase_classifier.network import PhaseFeatures, PhaseNetwork, PhaseSizes

    torch.manual_seed(0)
    features = PhaseFeatures(2, True)
    network = PhaseNetwork(features.channels, 2, PhaseSizes(4, 4, 2))
    roles = ("left_wrist", "right_wrist")
    FrozenPhaseClassifier(network, features, "stroke", "wrists", roles).save(folder / "c.pt")
    return [folder / "c.pt"]


def published_trimodal(folder: Path) -> list[Path]:
    import argparse

    import torch

    from cospeech.methods.trimodal.networks import Generator

    torch.manual_seed(0)
    sizes = {"word_size": 3, "style_size": 2, "hidden_size": 4, "layers": 1}
    generator = Generator(5, 2, **sizes)
    arguments = argparse.Namespace(input_context="both")
    content = {"args": arguments, "gen_dict": generator.state_dict()}
    for name, zipped in (("new.bin", True), ("old.bin", False)):
        torch.save(content, folder / name, _use_new_zipfile_serialization=zipped)
    return [folder / "new.bin", folder / "old.bin"]


def small_gesticulator():
    """Networks of small layers within it: files of the published size are large to try many of."""
    from unittest.mock import patch

    from cospeech.methods.gesticulator import networks

    sizes = {"FRAME_SIZES": (3, 2), "REDUCED_SIZE": 4, "HIDDEN_SIZE": 3}
    return patch.multiple(networks, **sizes)


def published_gesticulator(folder: Path) -> list[Path]:
    import torch

    from cospeech.methods.gesticulator.networks import GesticulatorNetwork
    from cospeech.methods.gesticulator.published import PUBLISHED_LAYERS

    torch.manual_seed(0)
    with small_gesticulator():
        ours = GesticulatorNetwork(4 + 773, 45).state_dict()
    parts = ("weight", "bias")
    names = {f"{name}.{p}": f"{own}.{p}" for name, own in PUBLISHED_LAYERS.items() for p in parts}
    content = {
        "state_dict": {name: ours[own] for name, own in names.items()},
        "hyper_parameters": {"mean_pose": [0.1] * 45, "audio_dim": 4},
    }
    for name, zipped in (("new.ckpt", True), ("old.ckpt", False)):
        torch.save(content, folder / name, _use_new_zipfile_serialization=zipped)
    return [folder / "new.ckpt", folder / "old.ckpt"]


def _corpus(folder: Path, *more):
    from tests.corpora import make_recording, make_store

    names = ("ada", "ben", "ada", "ben")
    recordings = [make_recording(f"take{i}", n, 5.0) for i, n in enumerate(names)]
    return make_store(folder, [*more, *recordings])


def stores(folder: Path) -> list[Path]:
    from tests.corpora import make_recording
    from tests.fabricated.mocap import body, swinging

    shutil.rmtree(folder / "made", ignore_errors=True)
    turning = swinging(body(), "fuzz", 5.0, 15.0)
    store = _corpus(folder, replace(make_recording("turning"), motion=turning))
    names = ("manifest.json", "vocabulary.json", "annotations.jsonl", "positions.bin")
    names = (*names, "rotations_local.bin", "rest_offsets.bin")
    return [store.path / name for name in names]


def matching_databases(folder: Path) -> list[Path]:
    from cospeech.matching.features import MatchingSpec
    from cospeech.matching.fitting import database_folder, fit_database

    shutil.rmtree(folder / "made", ignore_errors=True)
    store, spec = _corpus(folder), MatchingSpec(chunk_frames=32)
    fit_database(store, spec)
    path = database_folder(store, spec)
    manifest = json.loads((path / "manifest.json").read_text())
    del manifest["manifest_hash"]
    (path / "manifest.json").write_text(json.dumps(manifest))
    names = ("manifest.json", "pose_features.npy", "words.npy", "usable.npy")
    return [path / name for name in names]


PAIRS_MADE_BY = {"database": "0" * 64, "settings": {"frames": 8}}


def pairs(folder: Path) -> list[Path]:
    from cospeech.methods.motion_matching.refinement.pairs import Pairs, PairSettings, write_pairs

    shutil.rmtree(folder / "pairs", ignore_errors=True)
    made = Pairs(
        PairSettings(frames=8),
        np.zeros((4, 2), np.int32),
        np.ones(4, np.int32),
        np.zeros((4, 2, 2), np.int32),
        0.5,
    )
    write_pairs(folder / "pairs", PAIRS_MADE_BY, lambda: made)
    return sorted((folder / "pairs").iterdir())


STRETCHES = [[0, 0, 150, 0, 0]]


def kept_features(folder: Path) -> list[Path]:
    from cospeech.corpus.features.acoustics import ENERGY
    from cospeech.corpus.features.keeping import Stretch, kept_rows
    from cospeech.corpus.splits import Span
    from tests.corpora import make_recording

    shutil.rmtree(folder / "made", ignore_errors=True)
    store = _corpus(folder, make_recording("heard"))
    kept_rows(store, ENERGY, 20.0, [Stretch(Span(*STRETCHES[0][:3]))], "energy")
    kept = store.path / "features" / "energy-1"
    return [next(kept.glob("*.npy")), next(kept.glob("*.json"))]


PRODUCT_KEY = "ab" * 32


def products(folder: Path) -> list[Path]:
    import torch

    from cospeech.training.products import Products

    made = Products(str(folder))
    made.write("classifier", PRODUCT_KEY, {"description": {"pitch": True}, "a": torch.ones(3)})
    path = made.path("classifier", PRODUCT_KEY)
    assert path is not None
    return [path]


def journals(folder: Path) -> list[Path]:
    from cospeech.corpus.build_folder import BuildFolder

    shutil.rmtree(folder / "build", ignore_errors=True)
    build = BuildFolder(folder / "build", {"schema": 1}, ["a.bin"])
    for number in range(3):
        build.write("a.bin", b"12345678")
        build.note({"source": f"take{number}", "recordings": [{"frames": 8}]})
    build.close()
    return [folder / "build" / name for name in ("journal.jsonl", "build.json", "a.bin")]


def audio(folder: Path) -> list[Path]:
    seconds = np.arange(4000) / 8000
    wave = 0.3 * np.sin(2 * np.pi * 220 * seconds) * (seconds < 0.4)
    paths = [folder / f"a.{suffix}" for suffix in ("wav", "flac", "ogg", "mp3")]
    for path in paths:
        soundfile.write(path, wave, 8000)
    return paths


def bvh(folder: Path) -> list[Path]:
    from tests.fabricated.mocap import body, put_bvh, swinging

    return [put_bvh(folder / "a.bvh", swinging(body(), "fuzz", 0.4, 30.0))]


def joint_maps(folder: Path) -> list[Path]:
    import cospeech.motion

    packaged = Path(cospeech.motion.__file__).parent / "joint_maps"
    return [
        Path(shutil.copy(path, folder / path.name)) for path in sorted(packaged.glob("*.yaml"))[:4]
    ]


def vectors(folder: Path) -> list[Path]:
    from tests.fabricated.fasttext import write_random_model

    rows = ["hello 0.1 0.2 0.3 0.4", "world 1 2 3 4", "you 0 -1 0.5 1e-3"]
    (folder / "m.vec").write_text("3 4\n" + "\n".join(rows) + "\n")
    return [folder / "m.vec", write_random_model(folder / "m.bin", ["hello", "world"], 4)]


def transcripts(folder: Path) -> list[Path]:
    items = [{"word": word.text, "start": word.start, "end": word.end} for word in WORDS]
    segments = [{"start": 0.1, "end": 3.0, "text": "so the big", "words": items[:3]}]
    aligned = [{**item, "case": "success", "alignedWord": item["word"]} for item in items]
    cues = "".join(f"{i}\n00:00:0{i},100 --> 00:00:0{i},900\nthe big wheel\n\n" for i in range(5))
    contents = {
        "a.TextGrid": textgrid(WORDS, 6.0),
        "a.tsv": tsv(WORDS),
        "a.ctm": "".join(f"a 1 {w.start:g} {w.end - w.start:.2f} {w.text}\n" for w in WORDS),
        "google.json": google_json(WORDS),
        "whisper.json": json.dumps({"text": "so", "segments": segments, "language": "en"}),
        "gentle.json": json.dumps({"transcript": "so", "words": aligned}),
        "vosk.json": json.dumps({"result": items, "text": "so the big"}),
        "a.srt": cues,
        "a.vtt": "WEBVTT\n\n" + cues.replace(",", "."),
        "lines.txt": "".join(f"['{w.text}', {w.start}, {w.end}]\n" for w in WORDS),
        "plain.txt": "so the big wheel turns slowly in 2021 and stops",
    }
    for name, text in contents.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in contents]


def phase_files(folder: Path) -> list[Path]:
    from tests.formats.test_phase_files import ANVIL, ELAN

    contents = {
        "a.anvil": ANVIL,
        "a.eaf": ELAN.format(more=""),
        "a.csv": "start,end,phase\n0.5,1.0,prep\n1.0,1.6,stroke\n1.6,2.2,hold\n",
    }
    for name, text in contents.items():
        (folder / name).write_text(text.replace("{encoding}", "UTF-8"), encoding="utf-8")
    return [folder / name for name in contents]


def uci(folder: Path) -> list[Path]:
    from tests.fabricated.uci import write_uci_video

    return [write_uci_video(folder, "a1", rows=30)]


def berkeley_tables(folder: Path) -> list[Path]:
    from tests.fabricated.berkeley import write_2d

    shutil.rmtree(folder / "set", ignore_errors=True)
    write_2d(folder / "set", ("oliver",), frames=12, intervals=2)
    root = folder / "set"
    sound = sorted(root.glob("oliver/train/audio/*.wav"))[0]
    keypoints = sorted(root.glob("oliver/keypoints_simple/*/*.txt"))[0]
    tables = ("frames_df_10_19_19.csv", "videos_links.csv", "intervals_df.csv")
    return [*(root / name for name in tables), keypoints, sound]


def berkeley_samples(folder: Path) -> list[Path]:
    from tests.fabricated.berkeley import write_2d, write_samples

    shutil.rmtree(folder / "set", ignore_errors=True)
    root = folder / "set"
    truth = write_2d(root, ("oliver",), frames=70, intervals=1, audio=None, keypoint_files=False)
    write_samples(root, truth)
    (root / "frames_df_10_19_19.csv").unlink()
    shutil.rmtree(root / "oliver" / "keypoints_simple")
    return [root / "train.csv", sorted(root.glob("oliver/train/npz/*.npz"))[0]]


def berkeley_3d(folder: Path) -> list[Path]:
    from tests.fabricated.berkeley import write_3d

    paths = write_3d(folder, counts={"train_noduplication": 1})
    return list(paths.values())


def ted(folder: Path) -> list[Path]:
    from tests.fabricated.ted import make_clip, write_values

    shutil.rmtree(folder / "lmdb_train", ignore_errors=True)
    video = {"vid": "made", "framerate": 25.0, "clips": [make_clip(3.0)]}
    write_values(folder / "lmdb_train", iter([(0, video)]))
    return [folder / "lmdb_train" / "data.mdb"]


def ted_samples(folder: Path) -> list[Path]:
    from tests.fabricated.ted import _samples, make_clip, write_values

    shutil.rmtree(folder / "lmdb_train_cache", ignore_errors=True)
    video = {"vid": "made", "framerate": 25.0, "clips": [make_clip(4.0)]}
    write_values(folder / "lmdb_train_cache", enumerate(_samples(iter([video]))))
    return [folder / "lmdb_train_cache" / "data.mdb"]


def records(folder: Path) -> list[Path]:
    values = {
        "status": "finished",
        "model": "trimodal",
        "data": "synthetic",
        "ablation": "full",
        "seed": 0,
        "created": "2026-01-01T00:00:00+00:00",
        "config": {"model": {"_target_": "cospeech.methods.motion_matching.KnnSearch"}, "seed": 0},
        "epochs": [{"epoch": 0, "val/fgd": 3.5}],
        "results": {"recordings": {"fgd": 3.5}, "references": {"noise": {"fgd": 1.0}}},
    }
    (folder / "run").mkdir(exist_ok=True)
    (folder / "run" / "record.json").write_text(json.dumps(values, indent=1))
    return [folder / "run" / "record.json"]
