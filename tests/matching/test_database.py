"""Databases fitted to a small corpus: content by hand, and every way a folder can be wrong."""

import json
from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.store import Store
from cospeech.corpus.store_writer import StoreWriter
from cospeech.errors import CospeechError, InputFileError
from cospeech.matching.database import VERSION, check_database, open_database
from cospeech.matching.features import MatchingSpec, Normalisation, search_joints, stack_taps
from cospeech.matching.fitting import database_folder, fit_database
from cospeech.matching.matching import Clip, match
from cospeech.matching.search import MatchingSearch
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.feature_sets.sphinx import sphinx_features
from cospeech.speech.speech import Speech, Word
from tests.corpora import make_recording, make_store

SHORT = MatchingSpec(chunk_frames=32, true_future=True)
PUBLISHED = MatchingSpec(chunk_frames=32)


def test_taps_by_hand():
    channels = np.array([[1, 10], [2, 20], [3, 30], [4, 40]], dtype=np.float32)
    expected = [[1, 10, 3, 30], [2, 20, 4, 40], [3, 30, 0, 0], [4, 40, 0, 0]]
    np.testing.assert_array_equal(stack_taps(channels, 2, 2), expected)
    np.testing.assert_array_equal(stack_taps(channels, 1, 2), channels)


def test_normalisation_goes_through_blocks():
    values = np.random.default_rng(0).normal(3, 2, (100, 5)).astype(np.float32)
    values[:, 4] = 7
    normalisation = Normalisation.over(lambda: np.split(values, [10, 40]))
    np.testing.assert_allclose(normalisation.mean, values.mean(0), rtol=1e-5)
    np.testing.assert_allclose(normalisation.deviation[:4], values.std(0)[:4], rtol=1e-5)
    normalised = normalisation(values)
    np.testing.assert_allclose(normalised.std(0)[:4], 1, rtol=1e-5)
    assert (normalised[:, 4] == 0).all()


def test_joints_without_fingers():
    joints = search_joints(UPPER_BODY)
    assert joints.roles == ("right_elbow", "right_wrist", "left_elbow", "left_wrist")
    assert joints.joints == joints.roles


def test_knuckles_are_the_joints_numbered_one():
    names = ["Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"]
    parents = [-1, 0, 1, 2, 3, 4]
    for side in ("Left", "Right"):
        names += [f"{side}UpLeg", f"{side}Shoulder", f"{side}Arm", f"{side}ForeArm", f"{side}Hand"]
        at = len(names)
        parents += [0, 3, at - 4, at - 3, at - 2]
        for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky"):
            for number, joint in enumerate(("", "1", "2", "3")):
                parents.append(at - 1 if number == 0 else len(names) - 1)
                names.append(f"{side}Hand{finger}{joint}")
    joints = search_joints(Skeleton("made", tuple(names), tuple(parents)))
    assert joints.joints == (
        "RightForeArm", "RightHand", "LeftForeArm", "LeftHand",
        "RightHandIndex1", "RightHandPinky1", "LeftHandIndex1", "LeftHandPinky1",
    )  # fmt: skip


@pytest.mark.parametrize("spec", [SHORT, PUBLISHED])
def test_content(tmp_path, spec):
    store = make_store(tmp_path)
    database = fit_database(store, spec)
    assert database.spoken_by("ben").tolist() == [i // 4 % 2 == 1 for i in range(16)]
    # Four training takes of 150 frames: four sequences each, 22 frames left over.
    assert database.usable.shape == (16, 32)
    assert database.recordings.tolist() == [i for i in range(4) for _ in range(4)]
    np.testing.assert_allclose(database.starts_s[:5], [0, 32 / 15, 64 / 15, 96 / 15, 0])
    assert database.pose_features.shape == (16, 32, 4 * 4 * 3)
    assert database.audio_features.shape == (16, 32, 8 * 14)
    assert database.search_roles == ("right_elbow", "right_wrist", "left_elbow", "left_wrist")
    wrist = database.pose_roles.index("left_wrist")
    positions = store.upper_body(1)
    relative = positions[:, 6] - positions[:, 0]
    np.testing.assert_allclose(database.poses[5, :, wrist], relative[32:64], atol=1e-6)
    # The last tap of the left wrist, six frames later: in the published way 0 where it would be
    # another sequence's.
    raw = (
        database.pose_features[5] * database.pose_normalisation.deviation
        + database.pose_normalisation.mean
    )
    later = relative[38:70].copy()
    if not spec.true_future:
        later[26:] = 0
    np.testing.assert_allclose(raw[:, -3:], later, atol=1e-5)
    audio = sphinx_features(store.audio(1, 0, 160_000), 15, 150)
    raw = (
        database.audio_features[5] * database.audio_normalisation.deviation
        + database.audio_normalisation.mean
    )
    later = audio[46:78].copy()
    if not spec.true_future:
        later[18:] = 0
    np.testing.assert_allclose(raw[:, -14:], later, rtol=1e-4, atol=1e-4)


def test_heads_phases_and_words(tmp_path):
    takes = [make_recording(f"t{i}", seed=i, phases=i != 1) for i in range(6)]
    takes[2] = make_recording("t2", words=(Word("Big", 1.0, 1.4),), phases=True)
    store = make_store(tmp_path, takes)
    database = fit_database(store, SHORT)
    assert database.pose_roles[-3:] == ("neck", "nose", "head")
    np.testing.assert_allclose(
        database.upper_body(database.poses[5]), store.upper_body(1)[32:64], atol=1e-6
    )
    assert database.speaker_names == ("ada",)
    assert database.spoken_by("ada").all()
    assert not database.spoken_by("ben").any()
    assert database.phases[0].tolist() == (np.arange(32) // 8 % 9).tolist()
    assert (database.phases[4:8] == -1).all()
    words = database.words
    assert words.vocabulary == ("one", "two", "three", "big")
    of_big = words.ids == 3
    assert words.recordings[of_big].tolist() == [2]
    assert (words.starts_s[of_big][0], words.ends_s[of_big][0]) == (1.0, 1.4)
    assert (words.recordings == 0).sum() == len(takes[0].speech.words)


def test_without_any_transcript(tmp_path):
    database = fit_database(make_store(tmp_path, [wordless(i) for i in range(6)]), SHORT)
    assert database.words.vocabulary == ()
    assert len(database.words.ids) == 0


def wordless(seed):
    take = make_recording(f"t{seed}", seed=seed)
    return replace(take, speech=Speech(take.speech.waveform, None))


def test_starts_without_a_known_future_are_left_out(tmp_path):
    # 130 frames: the fourth sequence ends at 128, and its last 12 frames hear beyond frame 129.
    store = make_store(tmp_path, [make_recording(f"t{i}", seconds=130 / 15) for i in range(3)])
    database = fit_database(store, SHORT)
    assert (~database.usable).sum(axis=1).tolist() == [0, 0, 0, 12]
    assert fit_database(store, PUBLISHED).usable.all()
    manifest = json.loads((database_folder(store, SHORT) / "manifest.json").read_text())
    assert manifest["unusable_frames"] == 12
    known = database.pose_features[database.usable]
    np.testing.assert_allclose(known.mean(axis=0), 0, atol=1e-4)


def test_nothing_is_read_beyond_a_span(tmp_path):
    def spans_of(folder, tail):
        loud = make_recording("loud")
        loud.speech.waveform[-80_000:] = tail
        with StoreWriter(folder, "made", {}, str(tail) * 64) as writer:
            writer.add(loud)
            spans = [Span(0, 0, 75), Span(0, 75, 110), Span(0, 110, 150)]
            return writer.finish({name: [span] for name, span in zip(SPLITS, spans, strict=True)})

    quiet, loud = (fit_database(spans_of(tmp_path / str(i), i), SHORT) for i in range(2))
    assert quiet.audio_features.shape == (2, 32, 112)
    np.testing.assert_array_equal(quiet.audio_features, loud.audio_features)


def test_it_is_built_once_and_opened_again(tmp_path):
    store = make_store(tmp_path)
    database = fit_database(store, SHORT)
    folder = database_folder(store, SHORT)
    before = (folder / "manifest.json").stat().st_mtime_ns
    again = fit_database(store, SHORT)
    assert (folder / "manifest.json").stat().st_mtime_ns == before
    assert isinstance(again.pose_features, np.memmap)
    assert again.hash == database.hash
    assert again.spec == SHORT
    for name in ("pose_features", "audio_features", "poses", "usable", "starts_s"):
        np.testing.assert_array_equal(getattr(again, name), getattr(database, name))
    assert fit_database(store, PUBLISHED).hash != database.hash
    assert sorted(path.name for path in folder.parent.iterdir()) == sorted(
        database_folder(store, spec).name for spec in (SHORT, PUBLISHED)
    )
    check_database(folder)


def test_folders_that_are_refused(tmp_path):
    store = make_store(tmp_path)
    fit_database(store, SHORT)
    folder = database_folder(store, SHORT)
    with pytest.raises(InputFileError, match=r"made from corpus 0{12}, not a{12}"):
        open_database(folder, "a" * 64)
    with pytest.raises(InputFileError, match=r"no matching database here\n.*fit_database"):
        open_database(tmp_path)
    text = (folder / "manifest.json").read_text()
    manifest = json.loads(text)
    changed = {name: value for name, value in manifest.items() if name != "manifest_hash"}
    words = changed["arrays"]["words"]["shape"]
    for content, message in (
        (json.dumps({**manifest, "version": 0}), f"version 0, this version reads {VERSION}"),
        (json.dumps([]), "version None"),
        ("{", "not valid JSON"),
        ("", "not valid JSON"),
        (text.replace("take", "tale").replace("fps", "fqs"), "it isn't what was written"),
        (json.dumps({"version": VERSION}), "damaged.*KeyError"),
        (json.dumps({**changed, "spec": {"fps": 15, "more": 1}}), "damaged.*more"),
        (json.dumps({**changed, "statistics": 3}), "damaged.*int"),
        (json.dumps({**changed, "speakers": []}), "an index is past the end of its list"),
        (json.dumps({**changed, "vocabulary": [3] * words[0]}), "vocabulary is no list of names"),
        (json.dumps({**changed, "pose_roles": ["a"]}), r"poses holds float32 \(16, 32, 10, 3\)"),
        (json.dumps({**changed, "arrays": {"poses": 1}}), "damaged"),
    ):
        (folder / "manifest.json").write_text(content)
        with pytest.raises(InputFileError, match=message) as caught:
            open_database(folder)
        assert str(folder) in str(caught.value)
    assert fit_database(store, SHORT).usable.shape == (16, 32)


def test_damaged_arrays(tmp_path):
    store = make_store(tmp_path)
    expected = fit_database(store, SHORT).hash
    folder = database_folder(store, SHORT)
    path = folder / "audio_features.npy"
    whole = path.read_bytes()
    path.write_bytes(whole[:-4])
    with pytest.raises(InputFileError, match=r"audio_features.npy: is damaged"):
        open_database(folder)
    np.save(path, np.zeros((3, 32, 112), "f4"))
    with pytest.raises(InputFileError, match=r"holds float32 \[3, 32, 112\] where"):
        open_database(folder)
    path.write_bytes(b"")
    with pytest.raises(InputFileError, match=r"audio_features.npy: is damaged"):
        open_database(folder)
    path.unlink()
    assert fit_database(store, SHORT).hash == expected
    path.write_bytes(whole[:-4] + b"\0\0\0\0")
    open_database(folder)
    with pytest.raises(InputFileError, match="isn't what was written"):
        check_database(folder)


def test_recordings_too_short(tmp_path):
    store = make_store(tmp_path, [make_recording(f"t{i}", seconds=3.0) for i in range(3)])
    with pytest.raises(CospeechError, match=r"as long as a sequence \(4.26667 s\)"):
        fit_database(store)
    assert not list((store.path / "matching").iterdir())


def test_speech_is_heard_by_the_database(tmp_path):
    store = make_store(tmp_path)
    database = fit_database(store, SHORT)
    waveform = store.audio(0, 0, 160_000)
    heard = database.audio_queries(waveform)
    assert heard.shape == (150, 112)
    # The training recordings share their audio, so the database has the same features.
    np.testing.assert_allclose(
        heard[:128].reshape(4, 32, 112), database.audio_features[:4], atol=1e-4
    )
    matched = match(MatchingSearch(database), Clip(heard))
    assert matched.poses.shape == (150, len(database.pose_roles), 3)
    assert isinstance(Store(store.path), Store)
