"""Files that settings name are read before anything slow begins."""

from types import SimpleNamespace

import pytest

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.experiment import training
from cospeech.reporting.record import RunRecord
from tests.runs import Outputs, command


@pytest.mark.parametrize("name", ["encoder.pt", "missing.pt"])
def test_a_classifier_of_another_kind_is_refused_before_an_encoder_is_trained(
    name, tmp_path, monkeypatch
):
    outputs = Outputs(tmp_path / "outputs")
    data = SimpleNamespace(
        refuse_impossible=lambda *_: None, prepare_store=lambda: Store(outputs.store)
    )

    def build(node, **arguments):
        return made(node, **arguments) if "corpus" in arguments else data

    made = training.build
    monkeypatch.setattr(training, "build", build)
    run = tmp_path / "run"
    given = (
        "model=multi_adversary",
        "model.hidden_size=8",
        f"model.classifier={outputs.folder / name}",
        "model.products_dir=null",
        "choices.model=multi_adversary",
        f"run_dir={run}",
    )
    record = RunRecord(run / "record.json", {"id": "run", "config": {}})
    with command("train", *given) as cfg, pytest.raises(CospeechError, match=name):
        training._run(cfg, run, record)
