"""Files that somebody made to break a loader: each is named, nothing runs and nothing grows."""

import collections
import io
import json
import math
import pickle
import shutil
import zipfile
from pathlib import Path

import pytest
import torch

from cospeech.corpus.build_folder import BuildFolder
from cospeech.corpus.manifest import write_checksums, write_manifest
from cospeech.corpus.store import Store
from cospeech.encoders import encoder_for, keep_encoder
from cospeech.errors import InputFileError
from cospeech.evaluation import read_rows
from cospeech.formats.berkeley.rows import index_rows
from cospeech.formats.uci_phases import read_uci_recording
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.matching.database import open_database
from cospeech.metrics.encoder import load_any
from cospeech.nn.weights_file import filled, read_checkpoint, read_weights
from cospeech.training.products import Products
from tests.corpora import make_store
from tests.fuzz import seeds

HOSTILE = Path(__file__).parent / "data" / "hostile"


@pytest.mark.parametrize("read", [load_any, FrozenPhaseClassifier.load])
@pytest.mark.parametrize(
    ("case", "message"),
    [
        ("encoder_of_huge_shape/encoder.pt", "its tensors claim more than the 13145 bytes"),
        ("weights_short_pickle/encoder.pt", "can be read safely"),
        ("weights_bad_directory/c.pt", "can be read safely"),
        ("weights_invalid_argument/c.pt", "can be read safely"),
    ],
)
def test_weights(read, case, message):
    with pytest.raises(InputFileError, match=message) as caught:
        read(HOSTILE / case)
    assert str(HOSTILE / case) in str(caught.value)
    assert caught.value.hint


def test_timestamps_that_turn_200_times():
    path = HOSTILE / "uci_hours_from_timestamps" / "a1_raw.csv"
    with pytest.raises(InputFileError, match=r"a1_raw\.csv, line \d: \d+ s after the first row"):
        list(read_uci_recording(str(path)))


def test_a_header_with_a_carriage_return():
    path = HOSTILE / "berkeley_header_with_cr" / "frames.csv"
    with pytest.raises(InputFileError, match=r"frames\.csv"):
        index_rows(path, ["speaker", "interval_id"])
    with pytest.raises(InputFileError, match="can't be read"):
        index_rows(path.parent, ["speaker"])


def test_a_manifest_without_keys():
    with pytest.raises(InputFileError, match=r"manifest\.json: ") as caught:
        Store(HOSTILE / "store_manifest_without_keys")
    assert "it will be rebuilt" in caught.value.hint


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return make_store(tmp_path_factory.mktemp("hostile"))


@pytest.mark.parametrize(
    "change",
    [
        {"name": 3},
        {"fingerprint": None},
        {"dimensions": True},
        {"speakers": "ada"},
        {"speakers": [1]},
        {"splits": {"train": [[0, 0, 10**9]]}},
        {"splits": {"train": [[99, 0, 1]]}},
        {"splits": [1]},
        {"skeletons": []},
        {"remarks": None},
        {"skeletons": [{"name": "a"}]},
        {"recordings": {"id": ["a"]}},
        {"rows": {}},
        {"streams": {"audio": {"dtype": "O", "width": 1, "rows": 10**12}}},
        {"statistics": []},
        {"window_grid": 5},
    ],
)
def test_manifest_values_of_other_types(store, tmp_path, change):
    folder = tmp_path / "store"
    folder.mkdir()
    for path in store.path.iterdir():
        if path.suffix == ".bin":
            (folder / path.name).symlink_to(path)
    shutil.copy(store.path / "vocabulary.json", folder)
    write_manifest(folder, {**store.manifest, **change})
    with pytest.raises(InputFileError, match=r"manifest\.json") as caught:
        Store(folder)
    assert "it will be rebuilt" in caught.value.hint


@pytest.mark.parametrize(
    ("fact", "value"), [("rows", 1), ("width", 7), ("width", True), ("width", 1.0), ("dtype", "O")]
)
def test_streams_are_as_wide_and_long_as_their_recordings(store, tmp_path, fact, value):
    folder = shutil.copytree(store.path, tmp_path / "s")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["streams"]["audio"][fact] = value
    write_manifest(folder, manifest)
    with pytest.raises(InputFileError, match=r"streams\.audio"):
        Store(folder)


@pytest.mark.parametrize("name", ["manifest.json", "vocabulary.json"])
def test_one_flipped_byte_of_a_store_is_found(tmp_path, name):
    path = make_store(tmp_path).path / name
    text = path.read_text()
    path.write_text(text.replace("ada", "adb", 1) if "ada" in text else text.replace("on", "no", 1))
    with pytest.raises(InputFileError, match=rf"{name}: damaged: it isn't what was written"):
        _ = Store(path.parent).vocabulary


def test_a_store_without_checksums_is_not_whole(tmp_path):
    folder = make_store(tmp_path).path
    (folder / "checksums.json").unlink()
    with pytest.raises(InputFileError, match=r"checksums\.json.*\n.*it will be rebuilt"):
        Store(folder)


def read_all(folder):
    store = Store(folder)
    return store.vocabulary, store.annotations(0)


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"\xff", b"[" * 5000, b"null"])
@pytest.mark.parametrize("name", ["manifest.json", "vocabulary.json", "annotations.jsonl"])
def test_side_files_of_a_store_that_are_no_json(tmp_path, name, content):
    path = make_store(tmp_path).path / name
    path.write_bytes(content)
    write_checksums(path.parent)
    with pytest.raises(InputFileError) as caught:
        read_all(path.parent)
    assert "it will be rebuilt" in caught.value.hint


def test_an_empty_array_of_a_database(tmp_path):
    with pytest.raises(InputFileError) as caught:
        open_database(HOSTILE / "matching_array_empty")
    assert "fit the database again" in caught.value.hint


def changed_zip(path: Path, change) -> None:
    """Write a zip file anew, its parts changed and its directory right."""
    with zipfile.ZipFile(path) as archive:
        parts = {entry.filename: archive.read(entry) for entry in archive.infolist()}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, change(name, content))
    path.write_bytes(buffer.getvalue())


def test_what_a_checkpoint_holds_comes_back(tmp_path):
    (path,) = seeds.checkpoints(tmp_path)
    found, expected = read_checkpoint(path, "h"), torch.load(path, weights_only=True)
    assert found.keys() == expected.keys()
    assert found["hyper_parameters"] == expected["hyper_parameters"]
    for name, tensor in expected["state_dict"].items():
        assert torch.equal(found["state_dict"][name], tensor)
    path.unlink()  # nothing of the file lies under the tensors
    assert found["state_dict"]["weight"].sum().isfinite()


def test_any_flipped_byte_of_a_checkpoint_s_numbers_is_found(tmp_path):
    (path,) = seeds.checkpoints(tmp_path)
    whole = path.read_bytes()
    numbers = torch.load(path, weights_only=True)["state_dict"]["weight"].numpy().tobytes()
    at = whole.index(numbers)
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    with pytest.raises(InputFileError, match="the checksum of its part"):
        read_checkpoint(path, "h")
    for content, message in ((b"", "is empty"), (whole[:-100], "damaged"), (b"\0" * 500, "safely")):
        path.write_bytes(content)
        with pytest.raises(InputFileError, match=message):
            read_checkpoint(path, "h")


def test_a_storage_that_claims_more_numbers_than_the_file_has(tmp_path):
    """Some releases of torch read past the part's end, into whatever memory lies there."""
    path = tmp_path / "a.pt"
    torch.save({"a": torch.ones(16)}, path)
    sixteen, many = b"K\x10", b"M\xff\xff"
    changed_zip(path, lambda name, data: data.replace(sixteen, many))
    with pytest.raises(InputFileError, match=r"claim more than the 64 bytes of a part"):
        read_weights(path, "h")


def test_zip_bombs_and_trees_that_refer_to_themselves(tmp_path):
    path = tmp_path / "a.pt"
    torch.save({"a": torch.zeros(100_000)}, path)
    parts = zipfile.ZipFile(path)
    with zipfile.ZipFile(tmp_path / "b.pt", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in parts.namelist():
            archive.writestr(name, parts.read(name))
    with pytest.raises(InputFileError, match="it unpacks to more than its size"):
        read_weights(tmp_path / "b.pt", "h")
    tree: list = [0] * 10
    for _ in range(20):
        tree = [tree] * 10  # 10**20 entries in some hundred bytes
    for content in ({"a": tree}, {"a": torch.zeros(1).expand(10**12)}):
        torch.save(content, path)
        with pytest.raises(InputFileError, match=r"refer to one another|claim more"):
            read_weights(path, "h")


def pickled_as(path: Path, values: bytes, zipped: bool) -> None:
    """Write a pickle as torch does, in the form of today or of before 1.6."""
    if zipped:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("archive/data.pkl", values)
            archive.writestr("archive/version", "3\n")
            archive.writestr("archive/byteorder", "little")
            archive.writestr("archive/data/0", bytes(16))
    else:
        magic = torch.serialization.MAGIC_NUMBER
        head = b"".join(pickle.dumps(one, 2) for one in (magic, 1001, {}))
        path.write_bytes(head + values + pickle.dumps([], 2))


def test_one_part_alone_holds_the_values(tmp_path):
    torch.save({"a": 1}, tmp_path / "a.pt")
    with zipfile.ZipFile(tmp_path / "a.pt", "a") as archive:
        archive.writestr("other/data.pkl", b"\x80\x02}.")
    with pytest.raises(InputFileError, match=r"2 parts are called data\.pkl"):
        read_weights(tmp_path / "a.pt", "h")


def test_two_parts_of_one_name_and_files_beyond_their_kind_are_refused(tmp_path):
    path = tmp_path / "a.pt"
    torch.save({"a": 1}, path)
    with pytest.raises(InputFileError, match="is too large"):
        read_weights(path, "h", largest_bytes=path.stat().st_size - 1)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(archive.namelist()[0].upper(), b"")
    with pytest.raises(InputFileError, match="two of its parts have the same name"):
        read_weights(path, "h")


def doubling(times: int) -> bytes:
    pairs = (b"h%c\x86q%c" % (place, place + 1) for place in range(times))
    return b"\x80\x02}q\xfe)q\x00" + b"".join(pairs)


OF_ONE = b"\x80\x02}(X\x01\0\0\0a("


@pytest.mark.parametrize("zipped", [True, False])
@pytest.mark.parametrize(
    ("values", "message"),
    [
        (doubling(60) + b"K\x01s.", "refer to one another too often"),
        (OF_ONE + b"]" * 300_000 + b"tu.", "far more values than networks have"),
        (OF_ONE + b"N" * 600_000 + b"tu.", "far more values than networks have"),
        (b"\x80\x02}(" + b"G\0\0\0\0\0\0\0\0N" * 2000 + b"u.", "keys are no texts"),
        (b"\x80\x02}q\0]q\1\x85q\2h\1h\2a.", "in a circle"),
        (b"\x80\x02ccollections\nOrderedDict\n]NN\x86a\x85R.", "in an unusual way"),
    ],
    ids=str.split("key objects opcodes keys circle dictionary"),
)
def test_pickles_that_take_far_longer_than_their_size(tmp_path, values, message, zipped):
    path = tmp_path / "a.pt"
    pickled_as(path, values, zipped)
    with pytest.raises(InputFileError, match=message):
        read_weights(path, "h")


@pytest.mark.parametrize("zipped", [True, False])
@pytest.mark.parametrize(
    ("device", "count", "message"),
    [
        (b"cpu", b"M\x28\x28", "claim more than the"),
        (b"meta", b"K\x04", "a storage on 'meta'"),
        (b"cpu", b"J\xff\xff\xff\xff", "unusual kind"),
    ],
)
def test_a_storage_is_no_larger_than_its_part(tmp_path, device, count, message, zipped):
    path = tmp_path / "a.pt"
    text = b"X%c\0\0\0%s"
    storage = (
        b"("
        + text % (7, b"storage")
        + b"ctorch\nFloatStorage\n"
        + text % (1, b"0")
        + text % (len(device), device)
        + count
        + (b"" if zipped else b"N")
        + b"tQ"
    )
    pickled_as(path, b"\x80\x02}X\x01\0\0\0a" + storage + b"s.", zipped)
    with pytest.raises(InputFileError, match=message):
        read_weights(path, "h")


def test_values_that_share_and_keys_of_an_optimiser_come_back(tmp_path):
    shared = (1, 2)
    weight = torch.ones(3)
    content = {
        "a": [shared, shared, {3: weight, (0.9, 0.99): True}],
        "b": collections.OrderedDict(c=weight, d=torch.nn.Parameter(weight)),
        "size": weight.shape,
    }
    for zipped in (True, False):
        torch.save(content, tmp_path / "a.pt", _use_new_zipfile_serialization=zipped)
        found = read_weights(tmp_path / "a.pt", "h")
        assert found["a"][1] == shared
        assert torch.equal(found["a"][2][3], weight)
        assert torch.equal(found["b"]["d"], weight)
        assert found["size"] == (3,)


def test_only_a_few_names_may_occur(tmp_path):
    path = tmp_path / "a.pt"
    for value in (torch.eye(3).to_sparse(), torch.float32, {1, 2}, torch.device("meta"), 1j):
        torch.save({"a": value}, path)
        with pytest.raises(InputFileError, match="which has no place in weights"):
            read_weights(path, "h")
    path.write_bytes(pickle.dumps({"a": 1}))
    with pytest.raises(InputFileError):
        read_weights(path, "h")


def test_a_network_is_made_only_for_weights_of_its_size():
    state = torch.nn.Linear(3, 2).state_dict()
    assert torch.equal(filled(lambda: torch.nn.Linear(3, 2), state).weight, state["weight"])
    made = []

    def huge():
        made.append(torch.get_default_device())
        return torch.nn.Linear(10**7, 10**7)

    with pytest.raises(ValueError, match=r"weight is \[2, 3\], not \[10000000, 10000000\]"):
        filled(huge, state)
    assert made == [torch.device("meta")]
    with pytest.raises(ValueError, match="no tensor bias"):
        filled(lambda: torch.nn.Linear(3, 2), {"weight": state["weight"]})
    for value, dtype in [(math.nan, torch.float32), (math.inf, torch.half), (1e39, torch.float64)]:
        bias = torch.tensor([0, value], dtype=dtype)
        with pytest.raises(ValueError, match="bias holds values that are not finite"):
            filled(lambda: torch.nn.Linear(3, 2), {**state, "bias": bias})
    for dtype in (torch.complex64, torch.int8, torch.bool):
        with pytest.raises(ValueError, match=f"bias holds {dtype}, not torch.float32"):
            filled(lambda: torch.nn.Linear(3, 2), {**state, "bias": state["bias"].to(dtype)})
    double = filled(lambda: torch.nn.Linear(3, 2), {**state, "bias": state["bias"].double()})
    assert torch.equal(double.bias, state["bias"])
    with pytest.raises(ValueError, match="no place for 'more'"):
        filled(lambda: torch.nn.Linear(3, 2), {**state, "more": state["bias"]})


def test_damaged_reference_rows_are_computed_again(tmp_path, caplog):
    path = tmp_path / "rows.json"
    assert read_rows(path) is None
    assert not caplog.messages
    path.write_text('{"noise": {"fgd": 3.5, "mae": null}}')
    assert read_rows(path) == {"noise": {"fgd": 3.5, "mae": None}}
    for content in ("", "{", "[1]", '{"noise": 3}', '{"noise": {"fgd": "x"}}', "{}", "\0"):
        path.write_text(content)
        assert read_rows(path) is None
        assert "the reference rows are computed again" in caplog.messages[-1]
        assert str(path) in caplog.messages[-1]


def test_damaged_products_of_stages_are_made_again(tmp_path, caplog):
    products = Products(str(tmp_path))
    key = "ab" * 32
    products.write("classifier", key, {"a": torch.ones(3)})
    path = products.path("classifier", key)
    whole = path.read_bytes()
    assert torch.equal(products.find("classifier", key)["a"], torch.ones(3))
    for content in (b"", whole[:-50], b"\x80\x02}q\x00."):
        path.write_bytes(content)
        assert products.find("classifier", key) is None
        assert "classifier is done again" in caplog.messages[-1]
        assert str(path) in caplog.messages[-1]
    products.write("pretraining", key, {})
    products.path("pretraining", key).rename(path)
    assert products.find("classifier", key) is None
    assert "not the product of classifier" in caplog.messages[-1]


def test_a_damaged_encoder_of_a_store_is_trained_again(store, caplog, monkeypatch, tmp_path):
    (ours, *_) = seeds.encoders(tmp_path)
    encoder = load_any(ours)
    trained = []

    def train(*arguments):
        trained.append(arguments)
        return encoder

    monkeypatch.setattr("cospeech.encoders._train", train)
    path = keep_encoder(store, encoder, 3, 0)
    whole = path.read_bytes()
    assert encoder_for(store, "trained", 3, 0).sha256 == encoder.sha256
    assert not trained
    for number, content in enumerate((b"", whole[:-100], b"[]"), 1):
        path.write_bytes(content)
        assert encoder_for(store, "trained", 3, 0).sha256 == encoder.sha256
        assert len(trained) == number
        assert path.read_bytes() == whole
        warnings = [text for text in caplog.messages if "trained again" in text]
        assert str(path) in warnings[-1]


@pytest.mark.parametrize("line", [b"{}\n", b"\xff\n", b'{"source": 1}\t00000000\n'])
def test_a_damaged_line_of_a_journal_ends_what_is_taken_up(tmp_path, caplog, line):
    seeds.journals(tmp_path)
    folder = tmp_path / "build"
    lines = (folder / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (folder / "journal.jsonl").write_bytes(lines[0] + line + lines[2])
    build = BuildFolder(folder, {"schema": 1}, ["a.bin"])
    assert [entry["source"] for entry in build.take_up()] == ["take0"]
    build.close()
    assert "built again" in caplog.messages[-1]
    assert (folder / "a.bin").stat().st_size == 8
    (folder / "build.json").write_bytes(b"")
    build = BuildFolder(folder, {"schema": 1}, ["a.bin"])
    assert list(build.take_up()) == []
    build.close()
    assert "the build starts anew" in caplog.messages[-1]
