"""A checkpoint is whole, or known not to be, whatever happened while it was written."""

import errno
import logging
import os
import resource
import shutil
import signal
import struct
import subprocess
import tempfile
import zipfile
from pathlib import Path

import pytest
import torch
from lightning import LightningModule, Trainer
from lightning.pytorch.callbacks import ModelCheckpoint

from cospeech.errors import CospeechError, InputFileError
from cospeech.nn.checkpoints import WholeCheckpoints, previous_of
from cospeech.nn.weights_file import read_checkpoint
from tests.killing import killed_writing


def content(number, size=1000):
    return {
        "state_dict": {"w": torch.full((size,), float(number)), "b": torch.zeros(3)},
        "epoch": number,
        "global_step": 10 * number,
    }


def read(path):
    return read_checkpoint(path, "no hint")


@pytest.fixture
def last(tmp_path):
    return tmp_path / "checkpoints" / "last.ckpt"


@pytest.fixture
def two(last):
    """The checkpoints of epochs 1 and 2 of a run."""
    keeping = WholeCheckpoints()
    for number in (1, 2):
        keeping.save_checkpoint(content(number), last)
    return last


def test_a_checkpoint_is_an_ordinary_file_of_torch(two):
    loaded = torch.load(two, weights_only=True)
    assert loaded["epoch"] == 2
    assert torch.equal(loaded["state_dict"]["w"], torch.full((1000,), 2.0))
    with zipfile.ZipFile(two) as archive:
        assert archive.testzip() is None
    assert sorted(p.name for p in two.parent.iterdir()) == ["last.ckpt", "last.previous.ckpt"]


def test_the_one_before_is_kept_of_the_last_alone(two):
    assert read(previous_of(two))["epoch"] == 1
    keeping = WholeCheckpoints()
    best = two.with_name("best.ckpt")
    for number in (1, 2):
        keeping.save_checkpoint(content(number), best)
    assert not previous_of(best).exists()


def test_every_flipped_byte_is_found_or_changes_nothing(last):
    saved = content(1, size=100)
    WholeCheckpoints().save_checkpoint(saved, last)
    data = last.read_bytes()
    found = 0
    for place in range(0, len(data), 11):
        changed = bytearray(data)
        changed[place] ^= 0x40
        last.write_bytes(changed)
        try:
            loaded = WholeCheckpoints().load_checkpoint(last)
        except InputFileError:
            found += 1
        else:  # the time of an entry, or the padding between two
            assert loaded["epoch"] == 1
            for name, tensor in saved["state_dict"].items():
                assert torch.equal(loaded["state_dict"][name], tensor), place
    assert found > 0.3 * len(data) / 11


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: data[: len(data) // 2],
        lambda data: data[: len(data) - 200],
        lambda data: b"\x00" * len(data),
        lambda data: b'{"epoch": 3}',
        lambda data: data.replace(struct.pack("f", 2), struct.pack("f", 3), 1),
    ],
    ids=["empty", "halved", "cut at its end", "zeros", "JSON", "a bit"],
)
def test_a_damaged_last_checkpoint_is_said_and_the_one_before_taken(two, damage, caplog):
    two.write_bytes(damage(two.read_bytes()))
    with caplog.at_level(logging.WARNING):
        assert WholeCheckpoints().load_checkpoint(two)["epoch"] == 1
    (said,) = caplog.messages
    assert str(two) in said
    assert f"taking the checkpoint before, {previous_of(two)} (epoch 1, step 10)" in said


def test_a_list_of_tensors_is_no_checkpoint(two):
    torch.save([torch.zeros(3)], two)
    assert WholeCheckpoints().load_checkpoint(two)["epoch"] == 1


def test_the_last_one_killed_away_between_two_renames_is_the_one_before(two):
    two.unlink()
    assert WholeCheckpoints().load_checkpoint(two)["epoch"] == 1


def test_when_none_is_whole_that_is_said_with_what_to_do(two):
    for path in (two, previous_of(two)):
        path.write_bytes(b"")
    with pytest.raises(CospeechError, match="no checkpoint is whole") as caught:
        WholeCheckpoints().load_checkpoint(two)
    assert str(two) in str(caught.value)
    assert str(previous_of(two)) in str(caught.value)
    assert "without ckpt_path" in str(caught.value.hint)


def test_a_damaged_checkpoint_never_takes_the_place_of_the_good_one(two):
    two.write_bytes(b"")
    keeping = WholeCheckpoints()
    keeping.load_checkpoint(two)
    keeping.save_checkpoint(content(3), two)
    assert read(two)["epoch"] == 3
    assert read(previous_of(two))["epoch"] == 1


def test_a_resumed_run_keeps_what_it_resumed_from(two):
    keeping = WholeCheckpoints()
    keeping.load_checkpoint(os.path.relpath(two))  # Lightning saves under the absolute path
    keeping.save_checkpoint(content(3), two)
    assert read(previous_of(two))["epoch"] == 2


def test_where_links_are_not_known_two_are_kept_as_well(two, monkeypatch):
    def no_links(source, target):
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    keeping = WholeCheckpoints()
    keeping.load_checkpoint(two)
    keeping.save_checkpoint(content(3), two)
    assert read(two)["epoch"] == 3
    assert read(previous_of(two))["epoch"] == 2


def test_a_checkpoint_of_torch_itself_is_read(tmp_path):
    path = tmp_path / "last.ckpt"
    torch.save(content(5), path)
    assert WholeCheckpoints().load_checkpoint(path)["epoch"] == 5


def test_nothing_is_unpickled(tmp_path):
    class Command:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "ran"),)

    path = tmp_path / "last.ckpt"
    torch.save({"state_dict": Command()}, path)
    with pytest.raises(InputFileError, match=r"last\.ckpt"):
        WholeCheckpoints().load_checkpoint(path)
    assert not (tmp_path / "ran").exists()


def test_a_full_disk_leaves_what_was_there_and_says_what_and_where(two, monkeypatch):
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    keeping = WholeCheckpoints()
    keeping.load_checkpoint(two)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (5000, limit[1]))
        with pytest.raises(CospeechError, match="File too large") as caught:
            keeping.save_checkpoint(content(3, size=10_000), two)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, ignored)
    assert str(two) in caught.value.problem
    assert "\n" not in caught.value.problem
    assert [read(path)["epoch"] for path in (two, previous_of(two))] == [2, 1]
    assert len(list(two.parent.iterdir())) == 2  # no half file eats the disk


def test_a_disk_that_fills_up_while_it_is_flushed(two, monkeypatch):
    def full(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    keeping = WholeCheckpoints()
    keeping.load_checkpoint(two)
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CospeechError, match="No space left on device"):
        keeping.save_checkpoint(content(3), two)
    assert [read(path)["epoch"] for path in (two, previous_of(two))] == [2, 1]
    assert len(list(two.parent.iterdir())) == 2


def test_what_a_killed_save_left_does_not_fill_the_disk(two):
    mine = two.with_name(".last.ckpt.0123.part")
    for left in (mine, two.with_name(".last.ckpt.0123abcd.part")):
        left.write_bytes(b"half")
    WholeCheckpoints().save_checkpoint(content(3), two)
    assert sorted(two.parent.iterdir()) == [mine, two, previous_of(two)]


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 1 MiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(folder)]
    try:
        mounted = subprocess.run(command, capture_output=True).returncode == 0
    except OSError:
        mounted = False
    if not mounted:
        pytest.skip("may not mount a file system here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow
def test_a_really_full_disk_leaves_what_was_there(small_disk):
    last = small_disk / "last.ckpt"
    keeping = WholeCheckpoints()
    keeping.save_checkpoint(content(1, size=100_000), last)
    with pytest.raises(CospeechError, match="No space left on device"):
        keeping.save_checkpoint(content(2, size=200_000), last)
    assert read(last)["epoch"] == 1
    keeping.save_checkpoint(content(3, size=1000), last)
    assert read(last)["epoch"] == 3


SAVE = """
import torch
from cospeech.nn.checkpoints import WholeCheckpoints

torch.set_num_threads(1)
keeping = WholeCheckpoints()
resumed = []


def write(number):
    if number > 1 and not resumed:
        resumed.append(keeping.load_checkpoint(sys.argv[1]))
    weights = torch.full((300_000,), float(number))
    content = {"state_dict": {"w": weights}, "epoch": number, "global_step": number}
    keeping.save_checkpoint(content, sys.argv[1])
"""


@pytest.mark.slow
def test_killed_at_any_moment_of_its_writing_at_most_one_save_is_lost(last, tmp_path):
    """TMPDIR is another file system, as where Lightning's own checkpoints were torn."""
    other = Path("/dev/shm")
    elsewhere = Path(tempfile.mkdtemp(dir=other if os.access(other, os.W_OK) else tmp_path))
    torn = 0
    for started, saved in killed_writing(SAVE, str(last), times=30, TMPDIR=str(elsewhere)):
        torn += any(last.parent.glob(".last.ckpt.*.part"))
        loaded = WholeCheckpoints().load_checkpoint(last)
        assert started < saved <= loaded["epoch"] <= saved + 1
        expected = torch.full((300_000,), float(loaded["epoch"]))
        assert torch.equal(loaded["state_dict"]["w"], expected)
        if saved > 1:
            assert read(previous_of(last))["epoch"] in (loaded["epoch"] - 1, loaded["epoch"])
    assert torn > 0  # kills did fall into the writing
    assert not list(elsewhere.iterdir())
    elsewhere.rmdir()


class Losses(LightningModule):
    """Ends its epochs with given losses; its weight counts them."""

    def __init__(self, losses):
        super().__init__()
        self.losses = losses
        self.weight = torch.nn.Parameter(torch.zeros(1))

    def training_step(self, batch, index):
        self.log("loss", self.losses[self.current_epoch], on_step=False, on_epoch=True)
        return (self.weight * batch).sum()

    def configure_optimizers(self):
        return torch.optim.SGD(self.parameters(), lr=1.0)


def trained(folder, losses, checkpoint=None):
    """The callback that keeps the best of epochs with these losses."""
    same = {"enable_version_counter": False, "save_on_train_epoch_end": True}
    best = ModelCheckpoint(folder / "checkpoints", "best", monitor="loss", **same)
    kept = ModelCheckpoint(folder / "checkpoints", "last", **same)
    trainer = Trainer(
        max_epochs=len(losses),
        accelerator="cpu",
        logger=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        callbacks=[best, kept],
        plugins=[WholeCheckpoints()],
    )
    batches = torch.utils.data.DataLoader(torch.ones(1, 1))
    trainer.fit(Losses(losses), batches, ckpt_path=checkpoint, weights_only=True)
    return best


@pytest.mark.filterwarnings("ignore:.*does not have many workers", "ignore:.*logging interval")
@pytest.mark.parametrize("way", [shutil.move, shutil.copytree])
@pytest.mark.parametrize("more", [[], [3.0]], ids=["no epochs left", "a worse epoch"])
def test_a_moved_run_keeps_its_best_checkpoint(tmp_path, way, more):
    losses = [1.0, 2.0]
    trained(tmp_path / "old", losses)
    way(tmp_path / "old", tmp_path / "new")
    folder = tmp_path / "new" / "checkpoints"
    best = trained(tmp_path / "new", losses + more, folder / "last.ckpt")
    assert best.best_model_score == 1.0
    assert best.best_model_path == str(folder / "best.ckpt")
    assert read(folder / "best.ckpt")["epoch"] == 0
    assert read(folder / "last.ckpt")["epoch"] == len(losses + more) - 1


@pytest.mark.parametrize(
    "callbacks",
    [
        None,
        [1],
        {"a": 1},
        {"a": {"dirpath": 3}},
        {"a": {"dirpath": "/gone"}},
        {"a": {"dirpath": "/gone", "best_model_path": 3, "best_k_models": [1]}},
        {"a": {"dirpath": "/gone", "best_model_path": "/gone/best.ckpt"}},
    ],
    ids=str,
)
def test_what_callbacks_of_others_kept_stays(last, callbacks):
    WholeCheckpoints().save_checkpoint({**content(1), "callbacks": callbacks}, last)
    assert WholeCheckpoints().load_checkpoint(last)["callbacks"] == callbacks
