"""A small download for every corpus of ``conf/data``, by the name of its yaml."""

from collections.abc import Callable
from pathlib import Path

from tests.fabricated.berkeley import write_2d, write_3d
from tests.fabricated.mocap import (
    TRINITY_BODY,
    bursts,
    put_bvh,
    put_text,
    put_wav,
    spoken,
    swinging,
    tsv,
    write_beat,
    write_genea_2023,
    write_trinity_release,
    write_zeggs,
)
from tests.fabricated.ted import write_ted
from tests.fabricated.uci import write_uci_video

SECONDS = 6.0


def _beat(root: Path) -> None:
    write_beat(root, ("2_scott_0_1_1", "2_scott_0_9_9", "2_scott_0_57_57"), SECONDS, fps=30.0)


def _berkeley_2d(root: Path) -> None:
    write_2d(root, ("oliver",), frames=100)


def _berkeley_3d(root: Path) -> None:
    write_3d(root)


def _genea(root: Path) -> None:
    names = {"trn_2023_v0_000": (1, 2), "val_2023_v0_000": (1, 2), "tst_2023_v0_000": (2, 1)}
    write_genea_2023(root, names, SECONDS)


def _mocap(root: Path) -> None:
    for speaker, seconds in (("ada", 20.0), ("ben", SECONDS)):
        name = f"{speaker}/take"
        put_bvh(root / f"{name}.bvh", swinging(TRINITY_BODY, name, seconds, 30))
        put_wav(root / f"{name}.wav", bursts(name, seconds))
        put_text(root / f"{name}.tsv", tsv(spoken(name, seconds)))


def _synthetic(root: Path) -> None:
    """Nothing to download."""


def _ted(root: Path) -> None:
    write_ted(root, videos=4, seconds_per_video=12.0)


def _trinity(root: Path) -> None:
    write_trinity_release(root, (16, 20), (3,), SECONDS, fps=30.0)


def _uci_phases(root: Path) -> None:
    root.mkdir()
    for seed, video in enumerate(("a1", "a2", "b1", "c1")):
        write_uci_video(root, video, rows=200, seed=seed)


def _zeggs(root: Path) -> None:
    write_zeggs(root, {"001_Neutral_0": False, "005_Neutral_4": True}, SECONDS)


DOWNLOADS: dict[str, tuple[Callable[[Path], None], ...]] = {
    "beat": (_beat,),
    "berkeley": (_berkeley_2d, _berkeley_3d),
    "genea": (_genea,),
    "mocap": (_mocap,),
    "synthetic": (_synthetic,),
    "ted": (_ted,),
    "trinity": (_trinity,),
    "uci_phases": (_uci_phases,),
    "zeggs": (_zeggs,),
}
"""Writers into a folder that doesn't exist; more than one where a corpus has several layouts."""
