"""Folders of finished runs, made without a training."""

import contextlib
import json
from pathlib import Path

import torch
from hydra import compose, initialize_config_dir

from cospeech.judges.motion_autoencoder import MotionAutoencoder
from cospeech.methods.motion_matching import MotionMatching
from cospeech.methods.multi_adversary import MultiAdversary
from cospeech.methods.trimodal import Trimodal
from cospeech.metrics.encoder import save_encoder
from tests import multi_adversary_runs
from tests.corpora import make_recording, make_store
from tests.fabricated.sound import save_wav

CONF = Path(__file__).resolve().parents[1] / "conf"
FINGERPRINT = 64 * "0"
METHODS = {
    "trimodal": (Trimodal, {"hidden_size": 8, "layers": 1}),
    "knn": (MotionMatching, {"chunk_frames": 32}),
    "multi_adversary": (MultiAdversary, multi_adversary_runs.SMALL),
}


@contextlib.contextmanager
def command(script: str, *overrides: str):
    """The settings of a command, in the surroundings that it has."""
    with initialize_config_dir(str(CONF), version_base="1.3"):
        yield compose(script, overrides=list(overrides))


class Outputs:
    """A folder of outputs with a prepared corpus, an encoder and finished runs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        takes = [make_recording(f"take{i}", "ab"[i % 2], seconds=12, seed=i) for i in range(6)]
        made = make_store(folder / "stores", takes)
        facts = made.facts()
        self.store = made.path.rename(folder / "stores" / f"made-{10 * 'a'}-{FINGERPRINT[:6]}")
        self.facts = {**facts, "store": str(self.store.absolute())}
        self.encoder = folder / "encoder.pt"
        save_encoder(MotionAutoencoder(self.facts).encoder("untrained"), self.encoder)
        self.audio = folder / "speech.wav"
        save_wav(self.audio, make_recording("a", seconds=3).speech.waveform)

    def run(
        self,
        model: str = "trimodal",
        name: str = "run",
        stage: str | None = None,
        below: str = "runs",
    ) -> Path:
        """A finished run of a method."""
        kind, arguments = METHODS[model]
        torch.manual_seed(0)
        method = kind(self.facts, **arguments)
        if stage is not None:
            method.progress = type(method.progress)(stage)
        folder = self.folder / below / name
        (folder / "checkpoints").mkdir(parents=True)
        for checkpoint in ("best", "last"):
            save_checkpoint(method, folder / "checkpoints" / f"{checkpoint}.ckpt")
        record = {
            "schema": 1,
            "id": name,
            "status": "ok",
            "model": model,
            "data": "synthetic",
            "ablation": "full",
            "seed": 0,
            "data_fingerprint": FINGERPRINT,
            "config": {
                "model": {"_target_": f"{kind.__module__}".removesuffix(".module"), **arguments},
                "data": {
                    "_target_": "data_modules.synthetic.SyntheticData",
                    "minutes": 4,
                    "store_dir": "stores",
                },
                "metrics": {
                    "encoder": str(self.encoder),
                    "encoder_epochs": 1,
                    "encoder_seed": 0,
                    "reference_seed": 0,
                },
                "training": {"epochs": 1},
                "choices": {"experiment": None},
            },
        }
        record["config"]["model"]["_target_"] += f".{kind.__name__}"
        write_record(folder, record)
        return folder


def save_checkpoint(method, path: Path, **changes) -> None:
    """As Lightning writes it, of what matters here."""
    content = {
        "epoch": 0,
        "global_step": 1,
        "state_dict": method.state_dict(),
        "hyper_parameters": dict(method.hparams),
    }
    method.on_save_checkpoint(content)
    torch.save({**content, **changes}, path)


def read_record(folder: Path) -> dict:
    return json.loads((folder / "record.json").read_text())


def write_record(folder: Path, record: dict) -> None:
    (folder / "record.json").write_text(json.dumps(record))
