"""Motion of a finished run for a recording of the user's."""

from __future__ import annotations

import logging
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from hydra.utils import get_class, to_absolute_path
from omegaconf import DictConfig, OmegaConf

from cospeech.errors import ConfigError
from cospeech.matching.control import read_values
from cospeech.methods.base import GestureMethod
from cospeech.methods.matched import MatchedMethod
from cospeech.motion.motion import Motion
from cospeech.reporting.files import replacing
from cospeech.reporting.player import PlayerClip, write_player
from cospeech.reporting.record import read_record
from cospeech.speech.audio import load_audio
from cospeech.speech.speech import SAMPLE_RATE, Speech
from cospeech.speech.transcript import read_transcript_with_timing

_log = logging.getLogger(__name__)


def generate(cfg: DictConfig) -> Motion:
    """Generate, and leave a page to watch and the positions as arrays.

    Writes ``player.html`` and ``motion.npz``: ``positions`` (T, 10, 3) float32, metres, ``joints``
    (their names) and ``fps``.

    Args:
        cfg: Composed from ``conf/generate.yaml``.

    Raises:
        ConfigError: ``run`` or ``audio`` isn't given, or the run has no such checkpoint or makes
            no motion.
        CospeechError: A file that can't be read, or what the method refuses.
    """
    for key, example in (("run", "run=outputs/runs/ID"), ("audio", "audio=speech.wav")):
        if OmegaConf.is_missing(cfg, key):
            raise ConfigError(f"{key} is not set", f"add {example}")
    method = _method(cfg)
    waveform = load_audio(to_absolute_path(cfg.audio))
    words = None
    if cfg.transcript is not None:
        path = to_absolute_path(cfg.transcript)
        transcript = read_transcript_with_timing(path, len(waveform) / SAMPLE_RATE)
        words = transcript.words
        for note in transcript.notes:
            _log.warning("%s: %s", cfg.transcript, note)
    speech = Speech(waveform, words)
    controls = None
    if cfg.controls is not None:
        found = read_values(to_absolute_path(cfg.controls))
        controls = found if isinstance(found, dict) else {"controls": found}
    started = time.perf_counter()
    try:
        motion = method.generate(
            speech,
            speaker=cfg.speaker,
            controls=controls,
            generator=torch.Generator().manual_seed(cfg.seed),
        )
    except ConfigError as error:
        if controls is None:
            raise
        raise ConfigError(f"{cfg.controls}: {error.problem}", error.hint) from None
    seconds = time.perf_counter() - started
    folder = Path(cfg.run_dir)
    folder.mkdir(parents=True, exist_ok=True)
    name = Path(cfg.audio).stem
    write_player(folder / "player.html", [PlayerClip(name, {"generated": motion}, speech)], name)
    with replacing(folder / "motion.npz") as temporary, temporary.open("wb") as file:
        joints = np.array(motion.skeleton.joints)
        np.savez(file, positions=motion.positions, joints=joints, fps=motion.fps)
    print(
        f"{motion.duration:.1f} s of motion in {seconds:.2f} s"
        f" ({motion.duration / max(seconds, 1e-9):.0f} times real time)\n"
        f"listen: {(folder / 'player.html').resolve()}\n"
        f"motion: {(folder / 'motion.npz').resolve()}"
    )
    return motion


def _method(cfg: DictConfig) -> GestureMethod:
    if cfg.checkpoint not in ("best", "last"):
        raise ConfigError(f"checkpoint={cfg.checkpoint!r} is not one of best, last")
    values = read_record(Path(cfg.run) / "record.json")
    path = Path(cfg.run) / "checkpoints" / f"{cfg.checkpoint}.ckpt"
    if not values or not path.is_file():
        raise ConfigError(
            f"run={cfg.run}: no record.json with checkpoints/{cfg.checkpoint}.ckpt there",
            "give the folder of a finished run, e.g. outputs/runs/ID",
        )
    kind = get_class(values["config"]["model"]["_target_"])
    if not issubclass(kind, GestureMethod):
        raise ConfigError(f"run={cfg.run}: a {values['model']} makes no motion")
    given: dict[str, Any] = {}
    if cfg.database is not None:
        if not issubclass(kind, MatchedMethod):
            raise ConfigError(f"a {values['model']} has no matching database: leave database out")
        given["database"] = to_absolute_path(cfg.database)
    model = kind.load_from_checkpoint(path, map_location="cpu", weights_only=True, **given)
    if isinstance(model, MatchedMethod):
        # Outputs that were moved have their stores beside their runs still.
        model.look_for_store(above / "stores" for above in Path(cfg.run).absolute().parents)
    return model.eval()
