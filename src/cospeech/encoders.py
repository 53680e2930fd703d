"""Which encoder judges a store: the packaged one, a given checkpoint, or one trained on it."""

from __future__ import annotations

import logging
import tempfile
from pathlib import Path

import lightning
from filelock import FileLock
from lightning import Trainer
from lightning.pytorch.callbacks import ModelCheckpoint, TQDMProgressBar

from cospeech.corpus.store import Store
from cospeech.corpus.window_loader import WindowLoader
from cospeech.corpus.windows import WindowDataset
from cospeech.errors import CospeechError
from cospeech.judges import EvaluationEncoder
from cospeech.metrics.encoder import (
    GestureEncoder,
    load_any,
    load_encoder,
    packaged_encoder,
    save_encoder,
)
from cospeech.motion.upper_body import EVALUATION_FRAMES
from cospeech.nn.checkpoints import WholeCheckpoints
from cospeech.nn.weights_file import read_checkpoint

BATCH_SIZE = 128
"""Windows per batch of the auto-encoder's training, as published.

See docs/facts/trimodal.md, section 2.4.
"""

_AGAIN = "run the command again: the encoder is trained anew"

logger = logging.getLogger(__name__)


def encoder_for(store: Store, choice: str, epochs: int, seed: int) -> GestureEncoder:
    """The encoder of the evaluation space.

    Args:
        store: The corpus it is for.
        choice: ``"packaged"``: that of the embedded corpus, which ships with the package;
            ``"trained"``: the 34-frame auto-encoder, trained on the store's training split the
            first time and kept under the store; else the path of a checkpoint, ours or published.
        epochs: Training epochs of a trained one.
        seed: Seed of a trained one.

    Raises:
        CospeechError: The checkpoint can't be used for 34-frame windows, or the packaged file
            isn't as it was shipped.
    """
    match choice:
        case "packaged":
            encoder = packaged_encoder()
        case "trained":
            encoder = _trained(store, epochs, seed)
        case _:
            encoder = load_any(choice, EVALUATION_FRAMES)
    logger.info("judged by the encoder %s (%s)", encoder.sha256[:12], choice)
    return encoder


def _trained(store: Store, epochs: int, seed: int) -> GestureEncoder:
    path = _path(store, epochs, seed)
    encoder = _kept(path)
    if encoder is None:
        path.parent.mkdir(exist_ok=True)
        # A second run that needs it waits here instead of training it too.
        with FileLock(str(path) + ".lock"):
            encoder = _kept(path)
            if encoder is None:
                logger.info("training the FGD encoder on %s (once; kept in %s)", store.name, path)
                save_encoder(_train(store, epochs, seed, path.parent), path)
    return encoder or load_encoder(path)


def _kept(path: Path) -> GestureEncoder | None:
    """The encoder that was trained before; None, with a warning, where its file is damaged."""
    if not path.is_file():
        return None
    try:
        return load_encoder(path)
    except CospeechError as error:
        logger.warning("%s: it is trained again", error.problem)
        return None


def is_kept(store: Store, epochs: int, seed: int) -> bool:
    """Whether the store has an encoder of these epochs and seed, so that none is to be trained."""
    return _kept(_path(store, epochs, seed)) is not None


def keep_encoder(store: Store, encoder: GestureEncoder, epochs: int, seed: int) -> Path:
    """Make an explicitly trained encoder the store's own for these epochs and seed."""
    path = _path(store, epochs, seed)
    path.parent.mkdir(exist_ok=True)
    save_encoder(encoder, path)
    return path


def _path(store: Store, epochs: int, seed: int) -> Path:
    return store.path / "encoders" / f"autoencoder-e{epochs}-s{seed}.pt"


def _train(store: Store, epochs: int, seed: int, place: Path) -> GestureEncoder:
    lightning.seed_everything(seed, verbose=False)
    model = EvaluationEncoder(corpus=store.facts())
    loaders = {}
    for split, shuffle in (("train", True), ("val", False)):
        dataset = WindowDataset(store, split, model.window, model.needs)
        size = min(BATCH_SIZE, len(dataset))
        loaders[split] = WindowLoader(dataset, size, seed, shuffle, drop_last=shuffle)
    # Beside its target, where there is room for it or for nothing: not where TMPDIR says.
    with tempfile.TemporaryDirectory(prefix=".training-", dir=place) as folder:
        best = ModelCheckpoint(folder, "best", monitor=model.monitor)
        trainer = Trainer(
            max_epochs=epochs,
            accelerator="cpu",
            devices=1,
            logger=False,
            enable_model_summary=False,
            num_sanity_val_steps=0,
            callbacks=[best, TQDMProgressBar(refresh_rate=10)],
            plugins=[WholeCheckpoints()],
        )
        trainer.fit(model, loaders["train"], loaders["val"])
        weights = read_checkpoint(best.best_model_path, _AGAIN)["state_dict"]
    model.load_state_dict(weights)
    return model.encoder(f"motion_autoencoder, {epochs} epochs on {store.name}")
