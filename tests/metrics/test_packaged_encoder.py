"""The encoder that ships with the package is the one of the embedded corpus, as it was made."""

import hashlib
import json
import shutil

import pytest
import torch

from cospeech.corpus.synthetic import synthesise
from cospeech.errors import CospeechError
from cospeech.experiment.building import build
from cospeech.judges.motion_autoencoder import MotionAutoencoder
from cospeech.metrics.encoder import packaged, packaged_encoder, save_encoder
from cospeech.metrics.evaluation_windows import to_evaluation_windows
from cospeech.motion.upper_body import EVALUATION_FRAMES, to_upper_body
from tests.corpora import make_recording, make_store
from tests.runs import command

RECIPE = json.loads(packaged.RECIPE.read_text())
MAKE_IT_AGAIN = "the packaged encoder is of other motion; " + " && ".join(RECIPE["commands"])


def test_the_file_is_the_encoder_that_its_recipe_is_of():
    encoder = packaged_encoder()
    assert encoder.sha256 == RECIPE["sha256"]
    assert encoder.frames == EVALUATION_FRAMES
    assert str(RECIPE["settings"]["training"]["epochs"]) in encoder.source


def test_it_was_trained_on_the_corpus_that_is_prepared_today():
    then = RECIPE["corpus"]["parameters"]
    text = json.dumps(then, sort_keys=True)
    assert RECIPE["corpus"]["fingerprint"] == hashlib.sha256(text.encode()).hexdigest()
    with command("train", "model=knn", "data=synthetic", "run_dir=x", "run_prefix=x") as cfg:
        now = build(cfg.data).store_parameters()
    # How a store lies on the disk is not what it holds.
    assert now | {"schema": None} == then | {"schema": None}, MAKE_IT_AGAIN


def test_the_corpus_moves_as_it_did_when_the_encoder_was_trained():
    pytest.importorskip("espeakng_loader", reason='needs pip install "cospeech[tts]"')
    settings, then = (RECIPE["corpus"][key] for key in ("parameters", "first_take"))
    arguments = (settings["settings"][key] for key in ("minutes", "seed", "speakers"))
    take = next(synthesise(*arguments))
    assert take.id == then["id"]
    windows = to_evaluation_windows(to_upper_body(take.motion))
    torch.testing.assert_close(
        packaged_encoder().encode_all(windows).mean(0),
        torch.tensor(then["mean_feature"]),
        rtol=0,
        atol=5e-4,
        msg=lambda told: f"{MAKE_IT_AGAIN}\n{told}",
    )


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The packaged files, in a folder of the test's."""
    for name in ("WEIGHTS", "RECIPE"):
        path = shutil.copy(getattr(packaged, name), tmp_path)
        monkeypatch.setattr(packaged, name, type(tmp_path)(path))
    packaged_encoder()
    return tmp_path


def refused():
    with pytest.raises(CospeechError) as caught:
        packaged_encoder()
    assert "install it again" in caught.value.hint
    assert "metrics.encoder=trained" in caught.value.hint
    return caught.value.problem


def test_another_encoder_in_its_place_is_refused(installed):
    store = make_store(installed, [make_recording(f"take{i}", seed=i) for i in range(6)])
    other = MotionAutoencoder(store.facts()).encoder("another")
    save_encoder(other, packaged.WEIGHTS)
    problem = refused()
    assert str(packaged.WEIGHTS) in problem
    assert other.sha256[:12] in problem
    assert RECIPE["sha256"][:12] in problem


@pytest.mark.parametrize("name", ["WEIGHTS", "RECIPE"])
@pytest.mark.parametrize("damage", ["absent", "cut", "another"])
def test_a_damaged_file_says_what_to_do(name, damage, installed):
    path = getattr(packaged, name)
    content = path.read_bytes()
    path.unlink()
    if damage != "absent":
        path.write_bytes(content[:-50] if damage == "cut" else b"[]")
    assert str(path) in refused()
