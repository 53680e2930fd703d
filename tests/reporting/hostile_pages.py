"""Every page that the project writes, of data whose every name is one given name."""

import dataclasses
import json
import re

import numpy as np

from cospeech.corpus.packing import pack_source
from cospeech.corpus.source import Dropped, Source
from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.errors import one_line
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.collect import collect
from cospeech.reporting.corpus_report import write_corpus_report
from cospeech.reporting.player import PlayerClip, write_player
from cospeech.reporting.report import write_report
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word
from cospeech.studies.multi_adversary_figures.findings import judge
from cospeech.studies.multi_adversary_figures.measured import Setting, SystemMotion
from cospeech.studies.multi_adversary_figures.measuring import measure_systems
from cospeech.studies.multi_adversary_figures.page import write_page
from tests.corpora import REST_POSE, make_recording
from tests.reporting.records import record

_ROLES = (
    "left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist",
)  # fmt: skip


def player(folder, name):
    """A clip, its track, words, phases and facts."""
    motion = Motion(UPPER_BODY, 15.0, np.repeat(REST_POSE[None], 30, axis=0))
    speech = Speech(np.zeros(SAMPLE_RATE, np.float32), (Word(name, 0.1, 0.9),))
    clip = PlayerClip(name, {name: motion}, speech, {name: [name] * 30}, {name: name})
    return write_player(folder / "player.html", [clip], name, name)


def report(folder, name):
    """Runs that finished and that did not, a damaged record, and a folder of that name."""
    runs = folder / "runs"
    runs.mkdir()
    line = one_line(name)  # records with other names are left out
    named = {
        "id": line, "model": line, "data": line, "ablation": line, "commit": name,
        "data_fingerprint": line, "encoder": {"sha256": name, "name": name},
        "versions": {name: name}, "references": {name: {"fgd": 1.0}},
    }  # fmt: skip
    metrics = {"epoch": 0, f"val/{name}": 1.0, "val/fgd": 2.0}
    config = {name: {name: name}}
    record(runs, 0, **named, config=config, epochs=[metrics])
    record(runs, 1, **named, status="failed", error=name)
    record(runs, 2, **named, status=line, samples=[name])
    record(runs, 3, **named, config={"model": {"other": name}})
    record(runs, 4, final={name: name, "windows": {name: 1.0}}, encoder=None)
    (record(runs, 5) / "record.json").write_text(json.dumps({"epochs": [{name: name}]}))
    named_so = runs / re.sub("[/\x00\ud800-\udfff]", "-", name)[:100]
    named_so.mkdir()
    run = record(named_so, 6, samples=["samples/player.html"])
    player(run / "samples", name)
    return write_report(collect(runs), runs / "report.html")


def corpus(folder, name):
    """Recordings, speakers, words, joints, skeleton, licence, source, and what was dropped."""
    joints = tuple(f"{joint}{name}" for joint in UPPER_BODY.joints)
    skeleton = Skeleton(name, joints, UPPER_BODY.parents)
    words = tuple(Word(name, k, k + 0.5) for k in range(5))
    recordings = []
    for i in range(3):
        made = make_recording(f"{i}{name}", name, seconds=6.0, words=words, seed=i, phases=True)
        motion = Motion(skeleton, 15.0, made.motion.positions)
        recordings.append(dataclasses.replace(made, motion=motion, licence=name, source=name))
    dropped = [Dropped(name, name, name), Dropped(name, name, name, is_fault=True)]
    with StoreWriter(folder / "s", name, {name: name}, "0" * 64, upper_body=False) as writer:
        writer.append(pack_source(Source(name, lambda: [*recordings, *dropped], ()), False))
        frames = writer.columns()["frames"]
        splits = ("train", "val", "test")
        store = writer.finish({s: [Span(i, 0, frames[i])] for i, s in enumerate(splits)})
    write_corpus_report(store, folder / "corpus.html")
    return folder / "corpus.html"


def figures(folder, name):
    """A system, a role, a phase, the corpus and the facts of the paper's figures."""
    rest = np.array([[0.2, 0.5, 0], [0.3, 0.2, 0], [0.3, 0, 0.2], [-0.2, 0.5, 0],
                     [-0.3, 0.2, 0], [-0.3, 0, 0.2], [0, 0.5, 0]])  # fmt: skip
    bones = ((6, 0), (0, 1), (1, 2), (6, 3), (3, 4), (4, 5))
    classes = ("preparation", "stroke", name)
    groups, alone = np.repeat(np.arange(4), 2), np.arange(0, 8, 2)
    setting = Setting((*_ROLES, name), bones, rest, groups, alone, classes)

    def motion(system, speed, seed=None):
        windows = np.tile(rest, (8, 100, 1, 1))
        windows[:, :, [2, 5], 1] += speed * np.arange(100)[None, :, None]
        takes = [windows[i : i + 2].reshape(200, 7, 3) for i in range(0, 8, 2)]
        phases = [np.repeat(np.arange(20) % 3, 10) for _ in takes]
        return SystemMotion(
            system, windows, takes, side_by_side=takes, phases=phases, seed=seed, fgd=1.0
        )

    found = measure_systems(setting, [motion("real", 0.01), motion(name, 0.02, 0)], 0, 20)
    path, facts = folder / "figures.html", [(name, name)]
    write_page(path, name, name, setting, found, judge(found), facts, found[0].phases)
    return path


PAGES = {"player": player, "report": report, "corpus": corpus, "figures": figures}
