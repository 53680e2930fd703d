"""Fake mocap corpora in the layouts of the published ones.

Bodies are human-sized, speak in noise bursts and swing their arms; sizes are arguments. What a file
holds is a function of its name and of time, so that an excerpt of a longer take is the same motion.
"""

import json
import zlib
from pathlib import Path

import numpy as np
import soundfile
from scipy.spatial.transform import Rotation

from cospeech.motion.bvh import write_bvh
from cospeech.motion.kinematics import skeleton_positions
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.speech.speech import Word

TALK = ("so", "I", "went", "to", "the", "small", "house", "by", "the", "river", "and", "then")

# joint, parent, offset in metres; the arms of the rest pose point sideways
_TRUNK = (
    ("Hips", None, (0, 0.95, 0)),
    ("Spine", "Hips", (0, 0.08, 0)),
    ("Spine1", "Spine", (0, 0.12, 0)),
    ("Spine2", "Spine1", (0, 0.12, 0)),
    ("Spine3", "Spine2", (0, 0.12, 0)),
    ("Neck", "Spine3", (0, 0.12, 0)),
    ("Neck1", "Neck", (0, 0.05, 0)),
    ("Head", "Neck1", (0, 0.05, 0)),
)
_SIDE = (
    ("Shoulder", "Spine3", (0.04, 0.08, 0)),
    ("Arm", "Shoulder", (0.14, 0, 0)),
    ("ForeArm", "Arm", (0.28, 0, 0)),
    ("Hand", "ForeArm", (0.25, 0, 0)),
    ("UpLeg", "Hips", (0.1, 0, 0)),
    ("Leg", "UpLeg", (0, -0.42, 0)),
    ("Foot", "Leg", (0, -0.42, 0)),
    ("ForeFoot", "Foot", (0, -0.05, 0.12)),
)
_TWH_NAMES = {
    "Hips": "b_root", "Spine": "b_spine0", "Spine1": "b_spine1", "Spine2": "b_spine2",
    "Spine3": "b_spine3", "Neck": "b_neck0", "Neck1": "b_neck1", "Head": "b_head",
    "HeadEnd": "b_head_null", "Shoulder": "shoulder", "Arm": "arm", "ForeArm": "forearm",
    "Hand": "wrist", "UpLeg": "upleg", "Leg": "leg", "Foot": "foot", "ForeFoot": "toe",
}  # fmt: skip


def body(extra: tuple = (), twh: bool = False) -> Skeleton:
    """The body with more joints; ``twh`` gives them the names of Talking With Hands."""
    rows = [*_TRUNK, *(row for row in extra if not row[0].startswith(("Left", "Right")))]
    rows += [
        (side + name, parent if parent in ("Spine3", "Hips") else side + parent, (sign * x, y, z))
        for side, sign in (("Left", 1), ("Right", -1))
        for name, parent, (x, y, z) in _SIDE
    ]
    rows += [row for row in extra if row[0].startswith(("Left", "Right"))]
    names = [row[0] for row in rows]
    shown = [_twh_name(name) for name in names] if twh else names
    parents = tuple(-1 if row[1] is None else names.index(row[1]) for row in rows)
    return Skeleton("fake", tuple(shown), parents, np.array([row[2] for row in rows], float))


def _twh_name(name: str) -> str:
    for side in ("Left", "Right"):
        if name.startswith(side):
            return f"b_{side[0].lower()}_{_TWH_NAMES[name.removeprefix(side)]}"
    return _TWH_NAMES[name]


TRINITY_BODY = body()
TWH_BODY = body((("HeadEnd", "Head", (0, 0.18, 0)),), twh=True)
_BEAT_ENDS = (
    ("HeadEnd", "Head", (0, 0.18, 0)),
    ("LeftHandRing", "LeftHand", (0.05, 0, 0)),
    ("RightHandRing", "RightHand", (-0.05, 0, 0)),
)
BEAT_BODY = body(_BEAT_ENDS)
ZEGGS_BODY = body(
    (
        _BEAT_ENDS[0],
        ("LeftForeArmEnd", "LeftForeArm", (0.24, 0, 0)),
        ("RightForeArmEnd", "RightForeArm", (-0.24, 0, 0)),
        ("RightToeBaseEnd", "RightForeFoot", (0, 0, 0.05)),
    )
)


def swinging(skeleton: Skeleton, name: str, seconds: float, fps: float, start: float = 0.0):
    """Motion of a take from a second of it on: arms down and swinging, trunk swaying."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    times = start + np.arange(round(seconds * fps)) / fps
    rotations = np.zeros((len(times), len(skeleton), 4))
    rotations[..., 3] = 1
    for joint, sign in (("LeftArm", 1), ("RightArm", -1)):
        for part, down, bent in ((joint, 65, 12), (joint.replace("Arm", "ForeArm"), 15, 45)):
            rates, phases = rng.uniform(0.2, 0.8, 2), rng.uniform(0, 2 * np.pi, 2)
            swing, turn = np.sin(2 * np.pi * rates[:, None] * times + phases[:, None])
            angles = np.stack([-sign * (down + 12 * swing), sign * -(bent + 25 * turn)], axis=1)
            index = skeleton.index.get(part, -1)
            if index < 0:
                index = skeleton.index[_twh_name(part)]
            rotations[:, index] = Rotation.from_euler("ZY", angles, degrees=True).as_quat()
    sway = 4 * np.sin(2 * np.pi * 0.15 * times)
    rotations[:, 1] = Rotation.from_euler("z", sway[:, None], degrees=True).as_quat()
    positions = skeleton_positions(skeleton, rotations.astype(np.float32))
    return Motion(skeleton, fps, positions, rotations.astype(np.float32))


def spoken(name: str, seconds: float) -> tuple[Word, ...]:
    """Words of a take: a third of a second each, with pauses that differ from take to take."""
    rng = np.random.default_rng(zlib.crc32(name.encode()) + 1)
    words, time = [], 0.2
    while time + 0.3 < seconds:
        words.append(Word(TALK[len(words) % len(TALK)], round(time, 2), round(time + 0.3, 2)))
        time += 0.3 + rng.choice([0.05, 0.1, 0.5])
    return tuple(words)


def bursts(name: str, seconds: float, rate: int = 16_000) -> np.ndarray:
    """Audio of a take: noise while a word is spoken, near silence between words."""
    rng = np.random.default_rng(zlib.crc32(name.encode()) + 2)
    audio = 0.001 * rng.standard_normal(round(seconds * rate))
    for word in spoken(name, seconds):
        first, stop = round(word.start * rate), round(word.end * rate)
        audio[first:stop] += 0.2 * rng.standard_normal(stop - first)
    return audio.astype(np.float32)


def put_bvh(path: Path, motion: Motion, order: str = "ZXY") -> Path:
    """Write a motion in centimetres."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return write_bvh(path, motion, rotation_order=order)


def put_wav(path: Path, audio: np.ndarray, rate: int = 16_000) -> Path:
    """Write audio as float samples, so that not a bit is lost."""
    path.parent.mkdir(parents=True, exist_ok=True)
    soundfile.write(path, audio, rate, subtype="FLOAT")
    return path


def put_text(path: Path, text: str) -> Path:
    """Write a text file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def google_json(words: tuple[Word, ...]) -> str:
    """A transcript of the GENEA 2020 release."""
    items = [
        {"word": w.text, "start_time": f"{w.start:g}s", "end_time": f"{w.end:g}s"} for w in words
    ]
    return json.dumps([{"alternatives": [{"words": items, "transcript": "..."}]}])


def tsv(words: tuple[Word, ...]) -> str:
    """A transcript of GENEA 2022 and 2023."""
    return "".join(f"{w.start:g}\t{w.end:g}\t{w.text}\n" for w in words)


def textgrid(words: tuple[Word, ...], seconds: float) -> str:
    """A transcript of BEAT: a tier of words in Praat's long form."""
    intervals, time = [], 0.0
    for word in words:
        intervals += [(time, word.start, ""), (word.start, word.end, word.text)]
        time = word.end
    intervals.append((time, seconds, ""))
    rows = "".join(
        f"        intervals [{i}]:\n            xmin = {a:g}\n            xmax = {b:g}\n"
        f'            text = "{text}"\n'
        for i, (a, b, text) in enumerate(intervals, 1)
    )
    return (
        f'File type = "ooTextFile"\nObject class = "TextGrid"\n\nxmin = 0\nxmax = {seconds:g}\n'
        f"tiers? <exists>\nsize = 1\nitem []:\n    item [1]:\n"
        f'        class = "IntervalTier"\n        name = "words"\n        xmin = 0\n'
        f"        xmax = {seconds:g}\n        intervals: size = {len(intervals)}\n{rows}"
    )


def write_trinity_release(
    root: Path,
    training: tuple[int, ...] = (1, 9, 16, 20),
    test: tuple[int, ...] = (3, 10),
    seconds: float = 4.0,
    fps: float = 60.0,
) -> Path:
    """The GENEA 2020 release: synchronised, 60 fps, 48 kHz."""
    for folder, names in (
        ("Training_data", [f"Recording_{n:03d}" for n in training]),
        ("Test_data", [f"TestSeq{n:03d}" for n in test]),
    ):
        for name in names:
            at = root / folder
            put_bvh(at / "Motion" / f"{name}.bvh", swinging(TRINITY_BODY, name, seconds, fps))
            put_wav(at / "Audio" / f"{name}.wav", bursts(name, seconds, 48_000), 48_000)
            put_text(at / "Transcripts" / f"{name}.json", google_json(spoken(name, seconds)))
    return root


def write_trinity_raw(
    root: Path,
    number: int,
    motion_lead: float,
    audio_lead: float,
    seconds: float = 4.0,
    fps: float = 120.0,
) -> tuple[Motion, np.ndarray]:
    """A take as recorded, and the synchronised motion and audio that are in it.

    The motion file starts ``motion_lead`` seconds and the audio ``audio_lead`` seconds before what
    both have.
    """
    name = f"NaturalTalking_{number:03d}"
    whole = swinging(TRINITY_BODY, name, motion_lead + seconds, fps, -motion_lead)
    shared = bursts(name, seconds)
    rng = np.random.default_rng(number)
    lead = 0.01 * rng.standard_normal(round(audio_lead * 16_000)).astype(np.float32)
    put_bvh(root / "Motion" / f"{name}.bvh", whole)
    put_wav(root / "Audio" / f"{name}.wav", np.concatenate([lead, shared]))
    return swinging(TRINITY_BODY, name, seconds, fps), shared


def write_genea_2022(root: Path, names: dict[str, int], seconds: float = 4.0) -> Path:
    """GENEA 2022: ``names`` are recordings and their speakers."""
    for name, speaker in names.items():
        split = root / name[:3]
        put_bvh(split / "bvh" / f"{name}.bvh", swinging(TWH_BODY, name, seconds, 30))
        put_wav(split / "wav" / f"{name}.wav", bursts(name, seconds, 44_100), 44_100)
        put_text(split / "tsv" / f"{name}.tsv", tsv(spoken(name, seconds)))
        with (split / f"{name[:3]}_metadata.csv").open("a") as table:
            table.write(f"{name},finger_{'incl' if speaker % 2 else 'excl'},{speaker}\n")
    return root


def write_genea_2023(
    root: Path, names: dict[str, tuple[int, int]], seconds: float = 4.0, held_back: bool = True
) -> Path:
    """GENEA 2023: ``names`` are dialogues and their two speakers.

    ``held_back``: the test dialogues lack the main agent's motion, as the challenge gave them out.
    """
    for name, speakers in names.items():
        split = root / "genea2023_dataset" / name[:3]
        for side in ("main-agent", "interloctr"):
            whole = f"{name}_{side}"
            if not (held_back and name.startswith("tst") and side == "main-agent"):
                put_bvh(
                    split / side / "bvh" / f"{whole}.bvh", swinging(TWH_BODY, whole, seconds, 30)
                )
            put_wav(split / side / "wav" / f"{whole}.wav", bursts(whole, seconds, 44_100), 44_100)
            put_text(split / side / "tsv" / f"{whole}.tsv", tsv(spoken(whole, seconds)))
        table = split / "metadata.csv"
        if not table.exists():
            put_text(
                table,
                "prefix,main-agent_id,main-agent_has_fingers,interloctr_id,interloctr_has_fingers\n",
            )
        with table.open("a") as file:
            file.write(f"{name},{speakers[0]},fingers_incl,{speakers[1]},fingers_excl\n")
    return root


def write_beat(
    root: Path, names: tuple[str, ...], seconds: float = 4.0, fps: float = 120.0
) -> Path:
    """BEAT's first edition: a folder per speaker number."""
    for name in names:
        stem = root / "beat_english_v0.2.1" / name.split("_")[0] / name
        put_bvh(stem.with_suffix(".bvh"), swinging(BEAT_BODY, name, seconds, fps), "XYZ")
        put_wav(stem.with_suffix(".wav"), bursts(name, seconds))
        put_text(stem.with_suffix(".TextGrid"), textgrid(spoken(name, seconds), seconds))
        put_text(stem.with_suffix(".json"), '{"names": ["jawOpen"], "frames": []}')
        put_text(stem.with_suffix(".txt"), "01_beat_align_1\t0.1\t0.4\t0.3\t0.1\tso\n")
        put_text(stem.with_suffix(".csv"), "0\n")
    return root


def write_zeggs(
    root: Path, names: dict[str, bool], seconds: float = 4.0, copies: tuple[str, ...] = ()
) -> Path:
    """ZeroEGGS: ``names`` are sequences and whether they validate; ``copies`` more file stems."""
    header = "audio_filename,style,capture_session,anim_bvh,validation\n"
    rows = ""
    for name, validates in names.items():
        for mirror in ("", "_mirror"):
            rows += (
                f"{name}.wav,{name.split('_')[1]},1,{name}{mirror}.bvh,{str(validates).upper()}\n"
            )
    put_text(root / "info.csv", header + rows)
    for stem in (*(f"{name}_x_1_0" for name in names), *copies):
        put_bvh(root / "clean" / f"{stem}.bvh", swinging(ZEGGS_BODY, stem[:3], seconds, 60), "ZYX")
        put_wav(root / "clean" / f"{stem}.wav", bursts(stem[:3], seconds, 48_000), 48_000)
    return root
