"""Motion of a finished run for a recording of the user's."""

from __future__ import annotations

import logging
import time
from pathlib import Path

import numpy as np
import torch
from hydra.utils import to_absolute_path
from omegaconf import DictConfig, OmegaConf

from cospeech.corpus.features import fields_of
from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment.finished_run import load
from cospeech.files import replacing
from cospeech.matching.control import read_values
from cospeech.motion.bvh import write_bvh
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import to_upper_body
from cospeech.reporting.player import PlayerClip, write_player
from cospeech.speech.reading import read_speech
from cospeech.speech.speech import Speech

logger = logging.getLogger(__name__)


def generate(cfg: DictConfig) -> Motion:
    """Generate, and leave a page to watch, the positions as arrays and the rotations as BVH.

    Writes ``player.html``; ``motion.npz``: ``positions`` (T, 10, 3) float32, metres, of the upper
    body, ``joints`` (their names) and ``fps``; and, of a method that makes rotations,
    ``motion.bvh``: its whole skeleton, centimetres (`write_bvh`).

    Args:
        cfg: Composed from ``conf/generate.yaml``.

    Raises:
        ConfigError: ``run`` or ``audio`` isn't given, the run or its checkpoint is none that may
            speak (`open_run`), or the method makes no motion.
        CospeechError: A file that can't be read or written, what the method refuses, or motion
            with NaN, of which nothing is written.
    """
    for key, example in (("run", "run=outputs/runs/ID"), ("audio", "audio=speech.wav")):
        if OmegaConf.is_missing(cfg, key):
            raise ConfigError(f"{key} is not set", f"add {example}")
    given = {} if cfg.database is None else {"database": to_absolute_path(cfg.database)}
    method = load(str(cfg.run), cfg.checkpoint, [cfg.data.store_dir], **given)
    transcript = None if cfg.transcript is None else to_absolute_path(cfg.transcript)
    speech = read_speech(to_absolute_path(cfg.audio), transcript)
    if transcript is None and any(field.reads == "words" for field in fields_of(method.needs)):
        logger.warning(
            "no transcript: %s reads words, too, and takes it that nobody speaks; add"
            " transcript=FILE, which may be plain text",
            type(method).__name__,
        )
    controls = None if cfg.controls is None else read_values(to_absolute_path(cfg.controls))
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
    if (frame := motion.first_bad_frame()) is not None:
        other = "last" if cfg.checkpoint == "best" else "best"
        raise CospeechError(
            f"run={cfg.run}: the motion holds NaN or infinity from frame {frame} on: the weights of"
            f" checkpoint={cfg.checkpoint} are damaged, or the training diverged",
            f"take another checkpoint (checkpoint={other}), or another run",
        )
    print(_written(motion, speech, Path(cfg.run_dir), Path(cfg.audio).stem, seconds))
    return motion


def _written(motion: Motion, speech: Speech, folder: Path, name: str, seconds: float) -> str:
    """Write the arrays, the BVH and then the page, and say where they are.

    Raises:
        CospeechError: One of them can't be written; where it is the page, the others are.
    """
    arrays, page = folder / "motion.npz", folder / "player.html"
    upper_body = to_upper_body(motion)
    with replacing(arrays) as temporary, temporary.open("wb") as file:
        joints = np.array(upper_body.skeleton.joints)
        np.savez(file, positions=upper_body.positions, joints=joints, fps=motion.fps)
    kept = f"motion: {arrays.resolve()}"
    if motion.rotations_local is not None and len(motion):
        kept += f"\nfor a rig: {write_bvh(folder / 'motion.bvh', motion).resolve()}"
    name = name.encode("utf-8", "replace").decode()  # of a file name that is no UTF-8
    try:
        write_player(page, [PlayerClip(name, {"generated": motion}, speech)], name)
    except Exception as error:  # whatever it is, the motion is made and kept
        logger.debug("no page", exc_info=True)
        raise CospeechError(
            f"{page}: the page can't be written ({str(error) or type(error).__name__}); the motion"
            f" is whole\n{kept}"
        ) from error
    return (
        f"{motion.duration:.1f} s of motion in {seconds:.2f} s"
        f" ({motion.duration / max(seconds, 1e-9):.0f} times real time)\n"
        f"listen: {page.resolve()}\n{kept}"
    )
