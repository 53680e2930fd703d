"""Records from anywhere: whatever they hold costs that record, and nothing else."""

import copy
import itertools
import json
import os
from pathlib import Path

import pytest

from cospeech.errors import InputFileError
from cospeech.reporting.collect import collect
from cospeech.reporting.record import RunRecord, load_record, read_record
from cospeech.reporting.record_schema import record_problems
from cospeech.reporting.report import text_report, write_report
from tests.reporting.records import record

HOSTILE = Path(__file__).parents[1] / "data" / "hostile"
ODD = (
    None, True, 3, 1e308, float("nan"), "\x00\ud800", "x" * 5000, [], [1, "a", None], {},
    {"a": {"b": [1]}},
)  # fmt: skip


@pytest.fixture
def good(tmp_path):
    folder = tmp_path / "runs"
    folder.mkdir()
    record(folder, fgd=2.0)
    return folder


def add(folder, values, name="other"):
    (folder / name).mkdir(exist_ok=True)
    text = values if isinstance(values, str) else json.dumps(values)
    (folder / name / "record.json").write_text(text)
    return folder / name / "record.json"


def shown(folder):
    """Text and page of a folder, which must have a page whatever it holds."""
    collection = collect(folder)
    page = write_report(collection, folder / "report.html")
    return collection, text_report(collection), page.read_text(encoding="utf-8")


def places(value, place=()):
    """Keys on the way to every value inside a value."""
    items = value.items() if isinstance(value, dict) else ()
    items = enumerate(value) if isinstance(value, list) else items
    for key, inner in items:
        yield (*place, key)
        yield from places(inner, (*place, key))


def with_value(values, place, value):
    changed = copy.deepcopy(values)
    at = changed
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    return changed


def test_one_bad_record_is_named_and_the_others_shown(tmp_path):
    # a copy: the report is written beside the records
    for name in ("a", "b"):
        text = (HOSTILE / "record_value_of_another_type" / name / "record.json").read_text()
        add(tmp_path, text, name)
    collection, text, page = shown(tmp_path)
    assert [run.id for run in collection.runs] == ["b"]
    ((path, reason),) = collection.damaged
    assert path == tmp_path / "a" / "record.json"
    assert reason == "data_fingerprint is a list, not a text"
    assert "a/record.json: damaged record, left out (data_fingerprint is a list" in text
    assert "data_fingerprint is a list, not a text" in page


def test_a_value_of_any_type_at_any_place_costs_at_most_its_record(good, tmp_path):
    values = json.loads(next(good.glob("*/record.json")).read_text())
    values["epochs"] = values["epochs"][:1]
    tried = list(itertools.product(places(values), ODD))
    assert len(tried) > 400
    for number, (place, odd) in enumerate(tried):
        add(good, with_value(values, place, odd), f"odd-{number}")
    collection, text, page = shown(good)
    refused = len(collection.damaged)
    assert len(collection.runs) + refused == len(tried) + 1
    assert 0.2 < refused / len(tried) < 0.8
    assert f"{next(good.glob('trimodal*')).name}/" in page
    assert text.count("damaged record") == refused


@pytest.mark.parametrize(("place", "odd"), [
    (("epochs", 2, "val/fgd"), 1e308), (("epochs", 2, "val/fgd"), "3"), (("seed",), [0]),
    (("final", "windows", "fgd"), [1]), (("references", "mean_pose"), 3), (("status",), {}),
    (("timings", "fit"), "long"), (("samples",), "player.html"), (("config",), [1]),
    (("encoder", "sha256"), 5), (("versions", "torch"), 2), (("dirty",), "no"),
    (("epochs", 1, "epoch"), 0.5), (("fit", "ended"), None), (("fit", "asked"), "2"),
    (("config", "model"), [1]), (("id",), "two\nlines"), (("ablation",), "x" * 300),
])  # fmt: skip
def test_what_is_wrong_is_named_with_its_key(good, place, odd):
    path = next(good.glob("*/record.json"))
    path.write_text(json.dumps(with_value(json.loads(path.read_text()), place, odd)))
    key = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place)[1:]
    with pytest.raises(InputFileError, match=r"record\.json: ") as raised:
        load_record(path)
    assert key in str(raised.value)
    assert read_record(path) == {}


DEEP = json.loads('{"a": ' * 41 + "1" + "}" * 41)


@pytest.mark.parametrize(("values", "told"), [
    ({"objective": True}, "objective is true or false, not a number"),
    ({"seed": True}, "seed is true or false, not a whole number"),
    ({"objective": 2e100}, "objective is 2.0e+100, too large to be measured"),
    ({"id": "x" * 256}, "id is no name"),
    ({"commit": "x" * 1001}, "commit has 1001 characters"),
    ({"timings": {"k" * 201: 1}}, "timings has a key of 201 characters"),
    ({"config": {"a": {"k" * 201: 1}}}, "config has a key of over 200 characters"),
    ({"config": DEEP}, "config is nested too deep or has too many values"),
    ({"config": {"a": [0] * 10_000}}, "config is nested too deep or has too many values"),
    ({"epochs": [{"val/fgd": 1}]}, "epochs[0] has no 'epoch'"),
    ({"epochs": [{"epoch": -1}]}, "epochs[0].epoch is -1, no number of an epoch"),
    ({"epochs": [{"epoch": 10**9}]}, "epochs[0].epoch is 1000000000, no number of an epoch"),
], ids=lambda value: value if isinstance(value, str) else "")  # fmt: skip
def test_each_bound_is_told(values, told):
    (problem,) = record_problems(values)
    assert problem.startswith(told)


def test_numbers_as_far_apart_as_numbers_go_can_be_drawn(good):
    values = json.loads(next(good.glob("*/record.json")).read_text())
    for number, pair in enumerate(
        itertools.product((0, 5e-324, 1e-310, 1.0, 1e20, 9e99), repeat=2)
    ):
        rows = [{"epoch": e, "val/fgd": y, "val/a": -y} for e, y in enumerate(pair)]
        final = {"windows": {"fgd": pair[0]}, "recordings": {"fgd": pair[1], "fgd_low": pair[0]}}
        add(good, values | {"seed": number, "epochs": rows, "final": final}, f"far-{number}")
    collection, _, page = shown(good)
    assert collection.damaged == []
    assert "nan" not in page


@pytest.mark.parametrize("text", [
    '{"config": ' + '{"a": ' * 5000 + "1" + "}" * 5001,
    "[" * 1_000_000,
    '{"seed": ' + "1" * 5000 + "}",
    json.dumps({"config": {str(i): i for i in range(20_000)}}),
    json.dumps({"config": {"k" * 100_000: {str(i): i for i in range(1000)}}}),
    json.dumps({"id": "x" * 1_000_000}),
    "",
    "nothing",
])  # fmt: skip
def test_depth_length_and_numbers_are_bounded(good, text):
    add(good, text)
    collection, told, _ = shown(good)
    assert len(collection.damaged) == 1
    assert len(collection.runs) == 1
    assert len(told) < 5000


def test_a_huge_record_is_not_read(good, tmp_path):
    path = add(good, "{}")
    with path.open("r+b") as file:
        file.truncate(2**40)  # a hole: the file takes no room
    collection, _, _ = shown(good)
    assert "too long" in collection.damaged[0][1]


def test_links_and_pipes_are_not_read(good, tmp_path):
    secret = tmp_path / "secret.json"
    secret.write_text('{"id": "secret", "status": "ok"}')
    (good / "linked").mkdir()
    (good / "linked" / "record.json").symlink_to(secret)
    (good / "pipe").mkdir()
    os.mkfifo(good / "pipe" / "record.json")
    (good / "loop").symlink_to(good)
    (good / "up").symlink_to(tmp_path)
    collection, text, page = shown(good)
    assert [(p.parent.name, reason) for p, reason in collection.damaged] == [
        ("linked", "is a link, which is not followed"),
        ("pipe", "can't be read: it is not a file"),
    ]
    assert len(collection.runs) == 1
    assert "secret" not in text.replace(str(tmp_path), "") + page.replace(str(tmp_path), "")


def test_samples_outside_the_run_are_not_linked(good, tmp_path):
    run = record(good, 1, samples=[
        "samples/player.html", "../other/x.html", "/etc/passwd", "samples/link.html",
        "linked/x.html", "samples/../samples/player.html", "n" * 900, "nul\x00.html",
        "record.json/x", "", ".", "samples",
    ])  # fmt: skip
    outside = tmp_path / "outside"
    for place in (run / "samples", outside, good / "other"):
        place.mkdir()
        (place / "player.html").write_text("x")
        (place / "x.html").write_text("x")
    (run / "samples" / "link.html").symlink_to(outside / "x.html")
    (run / "linked").symlink_to(outside)
    found = next(r for r in collect(good).runs if r.folder == run)
    assert found.samples() == [run / "samples" / "player.html"]


def test_what_a_run_writes_has_the_right_shape(tmp_path):
    path = tmp_path / "run" / "record.json"
    facts = {"id": "a", "model": "knn", "data": "mocap", "ablation": None, "seed": 0, "config": {}}
    kept = RunRecord(path, facts)
    kept.add_timing("fit", 2.5)
    kept.add_epoch(0, {"val/fgd": float("nan")})
    kept.update(
        data_fingerprint="f", encoder={"sha256": "e", "name": "trained"}, objective=None,
        final={"split": "test", "windows": {"fgd": 1.0}, "recordings": {"fgd": 2.0}},
        references={"noise": {"fgd": 1.0}}, samples=["samples/player.html"],
    )  # fmt: skip
    kept.finish("ok")
    assert record_problems(json.loads(path.read_text())) == []
    assert load_record(path, needs=("config", "model"))["timings"] == {"fit": 2.5}
    with pytest.raises(InputFileError, match="has no ablation"):
        load_record(path, needs=("config", "ablation"))
