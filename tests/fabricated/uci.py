"""Files in the layout of the UCI Gesture Phase set."""

from pathlib import Path

import numpy as np

HEADER = "lhx,lhy,lhz,rhx,rhy,rhz,hx,hy,hz,sx,sy,sz,lwx,lwy,lwz,rwx,rwy,rwz,timestamp,phase"
CYCLE = ("Rest", "Preparation", "Stroke", "Hold", "Retraction")

# Metres, as the camera sees it: x to the speaker's right, y down, z away.
STANDING = {
    "spine": (0.1, 0.2, 2.0),
    "head": (0.1, -0.32, 1.98),
    "left": (-0.1, 0.15, 1.75),
    "right": (0.3, 0.15, 1.75),
}


def write_uci_video(
    folder: Path, video: str, rows: int = 400, scale: float = 5.0, seed: int = 0
) -> Path:
    """One ``<video>_raw.csv``: hands that rise and sink with the phases, irregular sampling.

    A phase lasts half a second; the recording begins at 59:50, so that the hour turns.
    """
    rng = np.random.default_rng(seed)
    times = 59 * 60 + 50 + np.cumsum(rng.choice([0.031, 0.033, 0.047], size=rows)).round(3)
    lines = [HEADER]
    for time in times:
        phase = int(time * 2) % 5
        height = 0.3 * np.sin(np.pi * (time * 2 % 5) / 5) ** 2
        points = {}
        for side, short in (("left", "l"), ("right", "r")):
            wrist = STANDING[side] + np.array([0, -height, -height / 2])
            points[f"{short}w"], points[f"{short}h"] = wrist, wrist - np.array([0, 0, 0.07])
        points["h"], points["s"] = np.array(STANDING["head"]), np.array(STANDING["spine"])
        cells = []
        for joint in ("lh", "rh", "h", "s", "lw", "rw"):
            x, y, z = points[joint] + rng.normal(0, 0.001, 3)
            cells += [f"{5 + scale * x:.6f}", f"{5 + scale * y:.6f}", f"{z:.6f}"]
        total = round(time * 1000) % 3_600_000
        stamp = total // 60_000 * 100_000 + total % 60_000
        lines.append(",".join([*cells, str(stamp), CYCLE[phase]]))
    path = folder / f"{video}_raw.csv"
    path.write_text("\r\n".join(lines) + "\r\n", encoding="utf-8")
    return path
