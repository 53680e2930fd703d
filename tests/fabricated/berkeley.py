"""Fake Berkeley corpora in the published layouts, 2-D and 3-D, of any size.

Bodies are human-sized and wave their arms. Big files are written item by item, so that a benchmark
can make them at full size.
"""

import csv
import io
import zipfile
from pathlib import Path

import numpy as np
import soundfile

NTSC_STAMPS = 29.97 / 2
"""Frames per second that the published time stamps of 29.97 fps videos are made with."""

# Camera axes: x right in the picture (the speaker's left), y down, z away from the camera.
_BODY = {
    "head_top": (0.0, -0.62, 0.0), "neck": (0.0, -0.40, 0.0),
    "r_shoulder": (-0.18, -0.38, 0.02), "r_elbow": (-0.25, -0.12, 0.02),
    "r_wrist": (-0.18, -0.08, -0.22), "l_shoulder": (0.18, -0.38, 0.02),
    "l_elbow": (0.25, -0.12, 0.02), "l_wrist": (0.18, -0.08, -0.22),
    "r_hip": (-0.10, 0.0, 0.0), "l_hip": (0.10, 0.0, 0.0), "pelvis": (0.0, 0.0, 0.0),
    "spine": (0.0, -0.15, 0.02), "head": (0.0, -0.52, -0.08),
}  # fmt: skip
BODY_NAMES = tuple(_BODY)


def camera_bodies(frames: int, seed: int) -> np.ndarray:
    """``(frames, 55, 3)`` in the order of the files: camera axes, hands relative to the wrist."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames) / 15
    points = np.zeros((frames, 55, 3))
    points[:, :13] = np.array(list(_BODY.values()))
    for elbow, wrist, side in ((3, 4, -1.0), (6, 7, 1.0)):
        rate, phase = rng.uniform(0.3, 1.0), rng.uniform(0, 2 * np.pi)
        swing = np.sin(2 * np.pi * rate * times + phase)
        points[:, wrist, 0] += 0.10 * side * swing
        points[:, wrist, 1] -= 0.12 * np.cos(2 * np.pi * rate * times + phase)
        points[:, elbow, 0] += 0.03 * side * swing
    for root in (13, 34):
        # Finger joint k of finger f lies 2 cm further out and 1.5 cm beside its neighbour.
        for finger in range(5):
            for joint in range(3):
                points[:, root + 1 + 3 * finger + joint] = (
                    0.015 * (finger - 2), 0.02 * (joint + 1), -0.01 * joint)  # fmt: skip
            points[:, root + 16 + finger] = (0.015 * (finger - 2), 0.08, -0.03)
    return points


def coordinate_major(points: np.ndarray) -> np.ndarray:
    """``(frames, 55, 3)`` as the files' ``(frames, 165)``: all x, all y, all z."""
    return points.transpose(0, 2, 1).reshape(len(points), 165)


def tone(samples: int, item: int) -> np.ndarray:
    """Bursts of a tone whose pitch tells the item."""
    times = np.arange(samples) / 16000
    return 0.4 * np.sin(2 * np.pi * (150 + item % 50) * times) * (np.sin(8 * times) > 0)


def write_3d(
    folder: Path,
    speaker: str = "oliver",
    counts: dict[str, int] | None = None,
    *,
    compressed: bool = False,
    dtype: str = "<f8",
    change=None,
    images: bool = True,
    seed: int = 0,
) -> dict[str, Path]:
    """The files of one speaker; item ``i`` of a file has the motion of seed ``seed + i``.

    ``counts``: kind -> items, of ``train``, ``train_noduplication``, ``dev``,
    ``dev_noduplication`` and ``test``. ``change(points)`` alters each item's points, e.g. its axes.
    """
    counts = counts or {"train_noduplication": 6, "dev_noduplication": 3, "test": 2}
    paths = {}
    folder.mkdir(parents=True, exist_ok=True)
    for kind, count in counts.items():
        split, _, rest = kind.partition("_")
        name = f"{split}_{speaker}{'_' + rest if rest else ''}_data.npz"
        frames = 192 if split == "test" else 64
        samples = 204_800 if split == "test" else 68_267

        def body(item: int, frames: int = frames) -> bytes:
            points = camera_bodies(frames, seed + item)
            if change is not None:
                points = change(points)
            return coordinate_major(points).astype(dtype).tobytes()

        def wav(item: int, samples: int = samples) -> bytes:
            return tone(samples, item).astype("<f4").tobytes()

        def imgs(item: int, frames: int = frames) -> bytes:
            names = [f"/path/to/{speaker}/frames/{item}_{i}.jpg" for i in range(frames)]
            return np.array(names, dtype="<U64").tobytes()

        arrays = {
            "wav": (wav, (count, samples), "<f4"),
            "body": (body, (count, frames, 165), dtype),
            "face": (lambda item, f=frames: bytes(4 * 257 * f), (count, frames, 257), "<f4"),
        }
        if images:
            arrays["imgs"] = (imgs, (count, frames), "<U64")
        paths[kind] = folder / name
        method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
        with zipfile.ZipFile(paths[kind], "w", method, compresslevel=1) as archive:
            for array_name, (make, shape, descr) in arrays.items():
                with archive.open(f"{array_name}.npy", "w", force_zip64=True) as member:
                    member.write(npy_header(shape, descr))
                    for item in range(count):
                        member.write(make(item))
    return paths


def npy_header(shape: tuple[int, ...], descr: str) -> bytes:
    """The header of an array that is written piece by piece."""
    header = io.BytesIO()
    values = {"descr": descr, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(header, values)
    return header.getvalue()


def keypoints(frames: int, seed: int, shoulder_px: float = 200.0) -> np.ndarray:
    """``(frames, 2, 52)`` picture coordinates, y down, whole pixels; nose and eyes in 7 to 9."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames) / 15
    half = shoulder_px / 2
    points = np.zeros((frames, 2, 52))
    points[:] = np.array([[640.0], [300.0]])
    for first, sign in ((1, -1.0), (4, 1.0)):  # the right arm is left in the picture
        rate, phase = rng.uniform(0.3, 1.0), rng.uniform(0, 2 * np.pi)
        swing = np.sin(2 * np.pi * rate * times + phase)
        points[:, 0, first] += sign * half
        points[:, 1, first] += 10
        points[:, 0, first + 1] += sign * 1.3 * half
        points[:, 1, first + 1] += 1.5 * half
        points[:, 0, first + 2] += sign * (half + 0.6 * half * swing)
        points[:, 1, first + 2] += 1.8 * half + 0.4 * half * np.cos(2 * np.pi * rate * times)
        hand = 10 if sign > 0 else 31
        points[:, :, hand] = points[:, :, first + 2]
        for finger in range(5):
            for bone in range(4):
                k = hand + 1 + 4 * finger + bone
                points[:, 0, k] = points[:, 0, hand] + 3 * (finger - 2)
                points[:, 1, k] = points[:, 1, hand] + 5 * (bone + 1)
    points[:, :, 7:10] = np.array([[640, 630, 650], [240, 230, 230]])
    return np.rint(points)


def stamp(seconds: float) -> str:
    """``HH:MM:SS[.ffffff]``, without the fraction on whole seconds, as the tables have it."""
    micro = round(seconds * 1e6)
    whole, fraction = divmod(micro, 1_000_000)
    text = f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}"
    return f"{text}.{fraction:06d}" if fraction else text


def write_2d(
    root: Path,
    speakers: tuple[str, ...] = ("oliver", "seth"),
    *,
    frames: int = 150,
    intervals: int = 6,
    columns: int = 52,
    rate: float = NTSC_STAMPS,
    table: str = "frames_df_10_19_19.csv",
    video: str = "2._History_of_x_vs._pH_12:30.mkv",
    audio: str | None = "intervals",
    gaps: dict[int, tuple[int, int]] | None = None,
    shuffle: bool = False,
    shoulder_px: dict[str, float] | None = None,
    keypoint_files: bool = True,
    seed: int = 0,
) -> dict[tuple[str, str], dict]:
    """The set as downloaded; returns what each interval holds.

    Args:
        gaps: Interval number -> frames that have no row, first and last.
        audio: ``"intervals"``: ``train/audio`` as extracted; ``"videos"``: a wav beside each video;
            None: no sound.
        columns: 49 or 52.
        rate: Frames per second of the time stamps.
    """
    rows, truth, links, bounds = [], {}, [], []
    stem = video.rsplit(".", 1)[0]
    for who, speaker in enumerate(speakers):
        folder = root / speaker / "keypoints_simple" / stem
        folder.mkdir(parents=True, exist_ok=True)
        links.append((speaker, video, f"https://example.org/{speaker}"))
        begin = 0
        for number in range(intervals):
            name = f"{speaker}:{number}"
            split = ("train", "train", "train", "train", "dev", "test")[number % 6]
            points = keypoints(
                frames, seed + 100 * who + number, (shoulder_px or {}).get(speaker, 200.0)
            )
            # Frame numbers start anywhere; the first interval starts on a whole second.
            times = begin + np.arange(frames) / rate
            begin = np.ceil(times[-1]) + 1
            absent = range(0)
            if gaps and number in gaps:
                absent = range(gaps[number][0], gaps[number][1] + 1)
            kept = [i for i in range(frames) if i not in absent]
            for i in kept:
                clock = stamp(times[i])
                file = f"{stem}/{stem}_{clock.replace(':', '_')[1:]}.txt"
                if keypoint_files:
                    write_keypoints(root / speaker / "keypoints_simple" / file, points[i], columns)
                rows.append({
                    "frame_fn": file.replace(".txt", ".jpg"), "frame_id": 1000 * number + i,
                    "pose_dt": clock, "pose_fn": file, "speaker": speaker, "video_fn": video,
                    "interval_id": name, "dataset": split,
                    "video_link": "",
                })  # fmt: skip
            bounds.append((speaker, video, stamp(times[0]), stamp(times[-1]), name))
            if audio == "intervals":
                path = root / speaker / "train" / "audio"
                path = path / f"{name}-{stamp(times[0])}-{stamp(times[-1])}.wav"
                _write_sound(path, times[0], times[-1] - times[0])
            truth[speaker, name] = {
                "points": points,
                "times": times,
                "kept": np.array(kept),
                "split": split,
            }
        if audio == "videos":
            _write_sound(root / speaker / "videos" / f"{stem}.wav", 0.0, begin)
    if shuffle:
        np.random.default_rng(seed).shuffle(rows)
    _write_csv(root / table, list(rows[0]), [list(row.values()) for row in rows])
    _write_csv(root / "videos_links.csv", ["speaker", "video_fn", "link"], links)
    names = ["speaker", "video_fn", "start_time", "end_time", "interval_id"]
    _write_csv(root / "intervals_df.csv", names, bounds)
    return truth


def clock_sound(times: np.ndarray) -> np.ndarray:
    """A sound that tells its time: 0.4 sin(200 π t) plus a slow slope."""
    return 0.4 * np.sin(2 * np.pi * 100 * times) + 0.002 * times


def _write_sound(path: Path, start: float, duration: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    times = start + np.arange(round(duration * 44_100)) / 44_100
    mono = clock_sound(times)
    soundfile.write(path, np.stack([mono, mono], axis=1), 44_100, subtype="FLOAT")


def write_keypoints(path: Path, points: np.ndarray, columns: int) -> None:
    """One frame's text file, with its comment line."""
    if columns == 49:
        points = np.delete(points, [7, 8, 9], axis=1)
    lines = [" ".join(f"{value:.0f}" for value in row) for row in points]
    path.write_text("# keypoints\n" + "\n".join(lines) + "\n")


def write_samples(root: Path, truth: dict[tuple[str, str], dict], columns: int = 49) -> int:
    """``train.csv`` and ``train/npz`` as the published extraction makes them from 2-D data."""
    rows = []
    for (speaker, name), interval in truth.items():
        if interval["split"] == "test":
            continue
        points, times = interval["points"], interval["times"]
        if columns == 49:
            points = np.delete(points, [7, 8, 9], axis=2)
        folder = root / speaker / "train" / "npz"
        folder.mkdir(parents=True, exist_ok=True)
        count = round((times[-1] - times[0]) * 16000)
        sound = clock_sound(times[0] + np.arange(count) / 16000).astype(np.float32)
        for start in range(0, len(points) - 64, 5):
            at = times[start : start + 64]
            first, last = (int((t - times[0]) * 16000) for t in (at[0], at[-1]))
            file = f"{name}-{stamp(at[0])}-{stamp(at[-1])}.npz"
            images = np.array([f"/old/{speaker}/frames/{start + i}.jpg" for i in range(64)])
            np.savez(
                folder / file,
                pose=points[start : start + 64],
                imgs=images,
                audio=sound[first:last],
            )
            rows.append([
                f"/old/machine/{speaker}/train/audio/{name}.wav", interval["split"],
                stamp(at[-1]), name, f"/old/machine/{speaker}/train/npz/{file}", speaker,
                stamp(at[0]), "video.mp4",
            ])  # fmt: skip
    names = ["audio_fn", "dataset", "end", "interval_id", "pose_fn", "speaker", "start", "video_fn"]
    _write_csv(root / "train.csv", names, rows)
    return len(rows)


def _write_csv(path: Path, names: list[str], rows: list) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(rows)
