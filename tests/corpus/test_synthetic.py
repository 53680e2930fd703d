"""The embedded corpus: its truth agrees with its audio and its motion."""

import hashlib
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.synthetic import SKELETON, build_take, plan, synthesise
from cospeech.corpus.synthetic.lexicon import CONCEPT_OF_WORD, CONCEPTS, INDEPENDENT_HOLD
from cospeech.corpus.synthetic.sentences import talk, vocabulary
from cospeech.corpus.synthetic.speakers import cast
from cospeech.motion.joint_map import find_joint_map
from cospeech.motion.kinematics import skeleton_positions
from cospeech.motion.phases import PHASE_INDEX
from cospeech.speech.tts import speak_all

pytest.importorskip("espeakng_loader", reason='needs pip install "cospeech[tts]"')

FPS = 60


@pytest.fixture(scope="module")
def corpus():
    return list(synthesise(2, seed=3, speakers=4))


def joint(recording, name):
    return recording.motion.positions[:, SKELETON.index[name]].astype(np.float64)


def speed(recording, name):
    return np.linalg.norm(np.diff(joint(recording, name), axis=0), axis=-1) * FPS


def digest(recordings):
    total = hashlib.sha256()
    for recording in recordings:
        total.update(recording.id.encode())
        total.update(recording.speech.waveform.tobytes())
        total.update(repr(recording.speech.words).encode())
        total.update(recording.motion.positions.tobytes())
        total.update(recording.motion.rotations_local.tobytes())
        total.update(recording.phases.tobytes())
        total.update(json.dumps(recording.annotations, sort_keys=True).encode())
    return total.hexdigest()


_BUILD = """
import sys
sys.path.insert(0, {folder!r})
from test_synthetic import digest
from cospeech.corpus.synthetic import synthesise
if __name__ == "__main__":
    print(digest(synthesise(1, seed=11, speakers=2, workers={workers})))
"""


def test_the_same_bytes_in_every_process_and_with_any_number_of_workers(tmp_path, request):
    digests = [digest(synthesise(1, seed=11, speakers=2))]
    for workers in (1, 2):
        script = tmp_path / f"build_{workers}.py"
        script.write_text(_BUILD.format(folder=str(request.path.parent), workers=workers))
        built = subprocess.run(
            [sys.executable, str(script)], capture_output=True, text=True, check=True
        )
        digests.append(built.stdout.strip())
    assert len(set(digests)) == 1
    assert digest(synthesise(1, seed=12, speakers=2)) != digests[0]


def test_the_plan_says_what_will_come(corpus):
    takes = plan(2, seed=3, speakers=4)
    assert [take.id for take in takes] == [recording.id for recording in corpus]
    assert len({take.id for take in takes}) == len(takes) == 6
    assert {take.speaker.name for take in takes} == {"s01", "s02", "s03", "s04"}
    total = sum(recording.speech.duration for recording in corpus)
    assert total == pytest.approx(120, rel=0.15)


def test_an_hour_is_48_takes_of_a_minute_and_a_quarter():
    takes = plan(60, seed=0)
    assert len(takes) == 48
    assert {take.speaker.name for take in takes} == {f"s{i:02d}" for i in range(1, 17)}
    letters = [sum(len(line.sentence.text) for line in take.lines) for take in takes]
    assert min(letters) > 0.6 * max(letters)


def test_progress_counts_takes():
    seen = []
    list(synthesise(0.5, seed=0, progress=lambda done, total: seen.append((done, total))))
    assert seen == [(1, 2), (2, 2)]


def test_every_word_of_the_sentences_is_timed(corpus):
    for recording in corpus:
        said = " ".join(text for text, *_ in recording.annotations["sentences"])
        expected = [token.strip(",.?") for token in said.split()]
        words = recording.speech.words
        assert [word.text for word in words] == expected
        starts = [word.start for word in words]
        assert starts == sorted(starts)
        assert words[-1].end < recording.speech.duration


def test_words_are_louder_than_pauses(corpus):
    for recording in corpus:
        waveform = recording.speech.waveform.astype(np.float64)
        spoken = np.zeros(len(waveform), dtype=bool)
        for word in recording.speech.words:
            spoken[round(word.start * 16000) : round(word.end * 16000)] = True
        inside = np.sqrt(np.mean(waveform[spoken] ** 2))
        # 30 ms around words may still ring
        kernel = np.ones(960)
        near = np.convolve(spoken, kernel, mode="same") > 0.5
        outside = np.sqrt(np.mean(waveform[~near] ** 2))
        assert inside > 50 * outside


def test_motion_covers_the_audio_exactly(corpus):
    for recording in corpus:
        assert len(recording.speech.waveform) * FPS == len(recording.motion) * 16000
        assert len(recording.phases) == len(recording.motion)
        assert recording.motion.first_bad_frame() is None


def test_bones_keep_their_lengths(corpus):
    assert SKELETON.offsets is not None
    rest = np.linalg.norm(SKELETON.offsets, axis=-1)
    for recording in corpus:
        positions = recording.motion.positions.astype(np.float64)
        for parent, child in SKELETON.bones:
            lengths = np.linalg.norm(positions[:, child] - positions[:, parent], axis=-1)
            assert np.abs(lengths - rest[child]).max() < 1e-5


def test_rotations_give_the_positions_back(corpus):
    recording = corpus[0]
    again = skeleton_positions(
        SKELETON, recording.motion.rotations_local, recording.motion.positions[:, 0]
    )
    assert np.abs(again - recording.motion.positions).max() < 1e-5
    # no sign jumps, so rotations can be interpolated
    neighbours = np.sum(
        recording.motion.rotations_local[1:] * recording.motion.rotations_local[:-1], axis=-1
    )
    assert neighbours.min() > 0.9


def test_the_trinity_joint_map_fits():
    assert find_joint_map(SKELETON).name == "trinity"


def test_other_frame_rates_show_the_same_motion():
    take = plan(0.4, seed=5, speakers=2)[0]
    utterances = list(speak_all([(line.sentence.text, line.voice) for line in take.lines]))
    fast, slow = build_take(take, utterances, 60), build_take(take, utterances, 15)
    assert np.abs(fast.motion.positions[::4] - slow.motion.positions).max() < 1e-5
    assert fast.phases is not None
    assert (fast.phases[::4] == slow.phases).all()
    assert fast.annotations == slow.annotations


def test_the_body_stays_human(corpus):
    for recording in corpus:
        head, neck, hips = (joint(recording, name) for name in ("Head_end", "Neck", "Hips"))
        assert (head[:, 1] > neck[:, 1] + 0.2).all()
        assert np.abs(hips[:, [0, 2]]).max() < 0.25
        for side, sign in (("Left", 1), ("Right", -1)):
            assert np.ptp(joint(recording, f"{side}Foot"), axis=0).max() < 1e-5
            assert speed(recording, f"{side}Hand").max() < 4.0
            upper = joint(recording, f"{side}ForeArm") - joint(recording, f"{side}Arm")
            lower = joint(recording, f"{side}Hand") - joint(recording, f"{side}ForeArm")
            cosine = np.sum(upper * lower, axis=-1) / (0.29 * 0.26)
            bend = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
            assert bend.min() > 5
            assert bend.max() < 165
            # the elbow leaves the line from shoulder to wrist to the back, below or outwards
            way = upper + lower
            way /= np.linalg.norm(way, axis=-1, keepdims=True)
            aside = upper - way * np.sum(upper * way, axis=-1, keepdims=True)
            backwards = aside @ np.array([sign * 0.4, -1.0, -0.35])
            assert (backwards > 0).all()


def test_hands_stay_out_of_the_trunk(corpus):
    for recording in corpus:
        left, right = joint(recording, "LeftArm"), joint(recording, "RightArm")
        across = left - right
        across /= np.linalg.norm(across, axis=-1, keepdims=True)
        up = joint(recording, "Neck") - joint(recording, "Spine2")
        forward = np.cross(across, up)
        forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
        middle = joint(recording, "Spine2")
        for side in ("Left", "Right"):
            wrist = joint(recording, f"{side}Hand") - middle
            aside, ahead = np.sum(wrist * across, axis=-1), np.sum(wrist * forward, axis=-1)
            assert ahead[np.abs(aside) < 0.15].min(initial=1.0) > 0.08


def test_strokes_lead_their_syllables_by_a_fifth_of_a_second(corpus):
    leads = []
    for recording in corpus:
        for gesture in recording.annotations["gestures"]:
            leads.append(gesture["cause_time"] - gesture["stroke_start"])
            word = recording.speech.words[gesture["word_index"]]
            assert word.text == gesture["word"]
            assert word.start <= gesture["cause_time"] < word.end
            assert gesture["kind"] in CONCEPTS
    assert np.mean(leads) == pytest.approx(0.2, abs=0.02)
    assert 0.03 < np.std(leads) < 0.08


def test_phases_and_gestures_agree(corpus):
    for recording in corpus:
        phases = recording.phases
        assert phases[0] == phases[-1] == PHASE_INDEX["none"]
        for gesture in recording.annotations["gestures"]:
            middle = round((gesture["stroke_start"] + gesture["stroke_end"]) / 2 * FPS)
            held = gesture["kind"] == INDEPENDENT_HOLD
            assert phases[middle] == PHASE_INDEX["independent_hold" if held else "stroke"]
        strokes = np.flatnonzero(np.diff((phases == PHASE_INDEX["stroke"]).astype(int)) == 1)
        assert len(strokes) <= len(recording.annotations["gestures"])


def test_hands_move_in_strokes_and_rest_in_holds(corpus):
    moving, holding = [], []
    for recording in corpus:
        busiest = np.maximum(speed(recording, "LeftHand"), speed(recording, "RightHand"))
        labels = recording.phases[1:]
        moving.append(busiest[labels == PHASE_INDEX["stroke"]])
        holding.append(busiest[labels == PHASE_INDEX["hold"]])
    assert np.median(np.concatenate(moving)) > 5 * np.median(np.concatenate(holding))


def test_a_sentence_is_never_gestured_twice_alike():
    take = plan(0.4, seed=8, speakers=1)[0]
    line = take.lines[0]
    take = replace(take, lines=(line, replace(line, pause_before=1.0)))
    utterances = list(speak_all([(line.sentence.text, line.voice) for line in take.lines]))
    # the very same audio twice
    recording = build_take(take, [utterances[0], utterances[0]])
    (_, first, end, _), (_, second, *_) = recording.annotations["sentences"]
    frames = round((end - first) * FPS)
    start_one, start_two = round(first * FPS), round(second * FPS)
    for name in ("LeftHand", "RightHand"):
        wrist = joint(recording, name) - joint(recording, "Spine3")
        one = wrist[start_one : start_one + frames]
        two = wrist[start_two : start_two + frames]
        if np.ptp(one, axis=0).max() > 0.1:
            assert np.linalg.norm(one - two, axis=-1).mean() > 0.02


def test_speakers_differ_and_their_styles_are_stored(corpus):
    people = cast(4, seed=3)
    assert len({person.voice.name for person in people}) == 4
    assert len({person.style for person in people}) == 4
    for recording in corpus:
        person = next(p for p in people if p.name == recording.speaker)
        assert recording.annotations["style"]["amplitude"] == person.style.amplitude
        assert recording.annotations["voice"]["name"] == person.voice.name
    many = cast(40, seed=0)
    assert len({(p.voice.name, p.voice.pitch, p.voice.rate) for p in many}) == 40
    assert np.mean([p.style.amplitude for p in many]) == pytest.approx(1.025, abs=0.02)


def test_the_grammar_says_a_few_hundred_words_and_evokes_every_concept():
    words = vocabulary()
    assert 300 < len(words) < 600
    assert {CONCEPT_OF_WORD[word] for word in words if word in CONCEPT_OF_WORD} == set(
        CONCEPT_OF_WORD.values()
    )
    sentences = talk(np.random.default_rng(0), enough=20_000)
    said = {w.strip(",.?").lower() for s in sentences for w in s.text.split()}
    assert said <= words
    assert any(len(sentence.listed) >= 3 for sentence in sentences)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"minutes": 0}, "minutes must be positive"),
        ({"speakers": 0}, "at least one speaker"),
        ({"workers": 0}, "workers must be at least 1"),
        ({"minutes": 0.4, "fps": 0}, "fps must be positive"),
    ],
)
def test_arguments_out_of_range(arguments, message):
    with pytest.raises(ValueError, match=message):
        list(synthesise(**arguments))
