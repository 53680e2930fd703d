"""Motion of a finished run for a recording of the user's."""

from __future__ import annotations

import logging
import time
from pathlib import Path

import numpy as np
import torch
from hydra.utils import to_absolute_path
from omegaconf import DictConfig, OmegaConf

from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment.finished_run import open_run
from cospeech.files import replacing
from cospeech.matching.control import read_values
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import TakesControls
from cospeech.motion.motion import Motion
from cospeech.quoting import setting
from cospeech.reporting.player import PlayerClip, write_player
from cospeech.speech.audio import load_audio
from cospeech.speech.speech import SAMPLE_RATE, Speech
from cospeech.speech.transcript import read_transcript_with_timing

logger = logging.getLogger(__name__)


def generate(cfg: DictConfig) -> Motion:
    """Generate, and leave a page to watch and the positions as arrays.

    Writes ``player.html`` and ``motion.npz``: ``positions`` (T, 10, 3) float32, metres, ``joints``
    (their names) and ``fps``.

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
    method = _method(cfg)
    waveform = load_audio(to_absolute_path(cfg.audio))
    words = None
    if cfg.transcript is not None:
        path = to_absolute_path(cfg.transcript)
        transcript = read_transcript_with_timing(path, len(waveform) / SAMPLE_RATE)
        words = transcript.words
        for note in transcript.notes:
            logger.warning("%s: %s", cfg.transcript, note)
    speech = Speech(waveform, words)
    controls = None
    if cfg.controls is not None:
        if not isinstance(method, TakesControls):
            raise ConfigError(
                f"controls={cfg.controls}: a {type(method).__name__} takes no controls",
                "leave controls out",
            )
        controls = read_values(to_absolute_path(cfg.controls))
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
    """Write the arrays and then the page, and say where they are.

    Raises:
        CospeechError: One of them can't be written; where it is the page, the arrays are.
    """
    arrays, page = folder / "motion.npz", folder / "player.html"
    with replacing(arrays) as temporary, temporary.open("wb") as file:
        joints = np.array(motion.skeleton.joints)
        np.savez(file, positions=motion.positions, joints=joints, fps=motion.fps)
    kept = f"motion: {arrays.resolve()}"
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


def _method(cfg: DictConfig) -> GestureMethod:
    run = open_run(str(cfg.run), cfg.checkpoint)
    given = {} if cfg.database is None else {"database": to_absolute_path(cfg.database)}
    store = None
    if run.needs_store(**given):
        command = f"python prepare.py {setting('data.store_dir', str(cfg.data.store_dir))}"
        store = run.require_store([cfg.data.store_dir], command)
    return run.load(store, **given)
