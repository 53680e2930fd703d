import itertools
import json
import os
import re

import pytest

from cospeech.errors import CospeechError
from cospeech.reporting.__main__ import main
from cospeech.reporting.collect import collect
from cospeech.reporting.grouping import differences, group_runs
from cospeech.reporting.report import text_report, write_report
from tests.reporting.drawn import drawn
from tests.reporting.records import record


@pytest.fixture
def study(tmp_path):
    for seed, fgd in ((0, 1.0), (1, 2.0), (2, 6.0)):
        record(tmp_path, seed, fgd=fgd)
    record(tmp_path, 0, "trimodal__no_adversarial", fgd=4.0, weight=0.0)
    return tmp_path


def test_seeds_meet_in_one_group_and_ablations_do_not(study):
    groups = group_runs(collect(study).runs)
    assert [(g.label, len(g.runs)) for g in groups] == [
        ("trimodal", 3),
        ("trimodal, no adversarial", 1),
    ]
    summary = groups[0].summary("windows", "fgd")
    assert (summary.mean, summary.n) == (3.0, 3)
    assert summary.std == pytest.approx(7**0.5)
    assert groups[0].summary("recordings", "fgd").mean == 4.0
    assert groups[0].summary("windows", "unknown") is None


def judged_by(**metrics):
    """Config of a run with further metrics."""
    standard = {"joint_mae": {"_target_": "a.JointMAE", "seed_frames": 4}}
    named = {name: {"_target_": f"a.{name}", **more} for name, more in metrics.items()}
    catalogue = standard | named
    return {"config": {"metrics": {"encoder": "packaged", "catalogue": catalogue}}}


def test_a_further_metric_sets_no_runs_apart(tmp_path):
    record(tmp_path, 0, fgd=1.0, **judged_by())
    record(tmp_path, 1, fgd=3.0, **judged_by(silence={}, pause={"seconds": 1}))
    record(tmp_path, 2, fgd=5.0, **judged_by(silence={}))
    (group,) = group_runs(collect(tmp_path).runs)
    assert group.label == "trimodal"
    assert group.summary("windows", "fgd").mean == 3.0
    record(tmp_path, 0, "trimodal__no_audio", **judged_by(silence={}))
    full, other = (group.members[0] for group in group_runs(collect(tmp_path).runs))
    assert not any("catalogue" in key for key in differences([full, other]))


def test_a_metric_with_other_settings_is_another_number(tmp_path):
    record(tmp_path, 0, **judged_by())
    record(tmp_path, 1, **judged_by(pause={"seconds": 1}))
    record(tmp_path, 2, **judged_by(pause={"seconds": 2}))
    groups = group_runs(collect(tmp_path).runs)
    assert [[run.seed for run in group.runs] for group in groups] == [[0, 1], [2]]
    record(tmp_path, 3, **judged_by(joint_mae={"seed_frames": 0}))
    labels = [group.label for group in group_runs(collect(tmp_path).runs)]
    assert any("metrics.catalogue.joint_mae.seed_frames=0" in label for label in labels)


def test_damaged_and_odd_records_are_listed_not_fatal(study):
    (study / "cut").mkdir()
    (study / "cut/record.json").write_text('{"id": "x", "epo')
    (study / "list").mkdir()
    (study / "list/record.json").write_text("[1, 2]")
    (study / "deep").mkdir()
    (study / "deep/record.json").write_text("[" * 100_000)
    (study / "binary").mkdir()
    (study / "binary/record.json").write_bytes(b"\xff\xfe\x00")
    (study / "sparse").mkdir()
    odd = {"final": 3, "epochs": "none", "samples": None, "config": [], "encoder": "x", "new": 1}
    (study / "sparse/record.json").write_text(json.dumps(odd))
    collection = collect(study)
    assert sorted(path.parent.name for path, _ in collection.damaged) == [
        "binary",
        "cut",
        "deep",
        "list",
        "sparse",
    ]
    assert len(collection.runs) == 4
    text = text_report(collection)
    assert "sparse/record.json: damaged record, left out (config is a list, not an object" in text
    assert re.search(
        r"cut/record\.json: damaged record, left out \(line 1, column 1.*Untermin", text
    )
    page = write_report(collection, study / "report.html").read_text()
    assert "Damaged records" in page
    assert "holds a list, not an object" in page


def test_a_repeated_seed_counts_once_the_newest(study):
    record(study, 0, fgd=3.0, finished="2026-02-02T00:00:00+00:00")
    group = group_runs(collect(study).runs)[0]
    assert [run.seed for run in group.runs] == [0, 1, 2]
    assert group.summary("windows", "fgd").mean == pytest.approx((3 + 2 + 6) / 3)
    assert len(group.superseded) == 1


def test_unfinished_runs_do_not_count(study):
    record(study, 3, fgd=100.0, status="failed", error="ValueError: NaN\nmore", encoder=None)
    collection = collect(study)
    group = group_runs(collection.runs)[0]
    assert (len(group.runs), [run.seed for run in group.unfinished]) == (3, [3])
    assert "trimodal-synthetic-full-s3: failed: ValueError: NaN" in text_report(collection)


def test_numbers_of_different_encoders_never_meet(study):
    record(study, 3, fgd=50.0, encoder={"sha256": "encoder-2", "name": "published"})
    groups = group_runs(collect(study).runs)
    assert sorted((g.label, len(g.runs)) for g in groups)[:2] == [
        ("trimodal [encoder=encoder-1]", 3),
        ("trimodal [encoder=encoder-2]", 1),
    ]


def test_a_swept_setting_makes_groups_and_names_them(study):
    record(study, 0, weight=2.5)
    labels = [group.label for group in group_runs(collect(study).runs)]
    assert "trimodal [model.loss.adversarial=5.0]" in labels
    assert "trimodal [model.loss.adversarial=2.5]" in labels


def settings(weight=5.0, **data):
    return {"data": {"minutes": 4, **data}, "model": {"width": 8, "weight": weight}}


def test_labels_are_unique_by_whichever_settings_tell_most(tmp_path):
    """Three settings of one group alone come first; the one that tells all apart comes last."""
    first = settings(a=1, b=1, c=1)
    for config in (first, settings(weight=2.0), settings(weight=3.0), settings(weight=4.0)):
        record(tmp_path, config=config)
    groups = group_runs(collect(tmp_path).runs)
    labels = [group.label for group in groups]
    assert len(set(labels)) == 4
    assert all("model.weight=" in label for label in labels)


def test_labels_say_no_more_than_what_groups_are_made_of(tmp_path):
    record(tmp_path, config=settings(), commit="a")
    record(tmp_path, config=settings(weight=1.0), commit="b")
    labels = [group.label for group in group_runs(collect(tmp_path).runs)]
    assert labels == ["trimodal [model.weight=1.0]", "trimodal [model.weight=5.0]"]


def test_where_a_store_lies_and_who_reads_it_is_no_setting(tmp_path):
    record(tmp_path, 0, config=settings(store_dir="here", workers=None))
    record(tmp_path, 1, config=settings(store_dir="there", workers=4))
    assert [len(group.runs) for group in group_runs(collect(tmp_path).runs)] == [2]


def test_a_mean_of_fewer_values_than_runs_says_so(study):
    record(study, 3, final={"windows": {"fgd": None}, "recordings": {"fgd": 4.0}})
    text = text_report(collect(study), "markdown")
    assert "| trimodal | windows | 4 | 3.0 ± 2.6 (n=3) |" in text
    assert "| trimodal | recordings | 4 | 4.0 ± 2.2 |" in text


def test_why_different_names_what_differs_and_nothing_else(study):
    runs = {(run.values["ablation"], run.seed): run for run in collect(study).runs}
    assert differences([runs["full", 0], runs["full", 1]]) == {}
    table = differences([runs["full", 0], runs["trimodal__no_adversarial", 0]])
    assert table == {"model.loss.adversarial": [5.0, 0.0]}


def test_text_report_numbers(study):
    text = text_report(collect(study), "markdown")
    assert "Corpus synthetic corpus-1 · encoder own encoder-1" in text
    assert "| trimodal | windows | 3 | 3.0 ± 2.6 |" in text
    assert "| trimodal, no adversarial | windows | 1 | 4 |" in text
    assert "| trimodal | recordings | 3 | 4.0 ± 2.6 |" in text
    assert "| real halves | reference | \N{EN DASH} | 0.2500 |" in text
    assert "FGD ↓" in text


def test_page_is_self_contained_and_links_to_players(study):
    run = record(study, 5, samples=["samples/pl ayer.html", "../../secret.html", "missing.html"])
    (run / "samples").mkdir()
    (run / "samples/pl ayer.html").write_text("x")
    (study.parent / "secret.html").write_text("x")
    page = write_report(collect(study), study / "report.html").read_text()
    links = re.findall(r'href="([^"]*)"', page)
    runs = [f"{path.parent.name}/" for path in study.glob("*/record.json")]
    assert sorted(links) == sorted([*runs, f"{run.name}/samples/pl%20ayer.html"])
    assert not re.search(r"https?://|<script|src=", page)
    assert "<td><code>model.loss.adversarial</code></td><td>5</td><td>0</td>" in page
    assert "uncommitted" not in page
    assert "2.0 min" in page


def test_page_escapes_what_records_say(study):
    record(study, 9, id="<script>alert(1)</script>", status="failed", error="<img src=x>")
    page = write_report(collect(study), study / "report.html").read_text()
    assert "<script>" not in page
    assert "<img" not in page


def test_curves_are_where_the_numbers_say(study):
    page = write_report(collect(study), study / "report.html").read_text()
    lines = drawn(re.search(r"<svg.*?</svg>", page, re.S).group(0))
    assert len(lines) == 4
    ((points,),) = [paths for title, paths in lines if title == "trimodal, seed 0"]
    assert len(points) == 5
    # falling by one per epoch: equal steps right and down
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(points)]
    assert all(step[0] == pytest.approx(steps[0][0], abs=0.11) and step[1] > 0 for step in steps)


def test_command_prints_the_table_and_writes_the_page(study, capsys):
    assert main([str(study)]) == 0
    printed = capsys.readouterr().out
    assert "3.0 ± 2.6" in printed
    assert (study / "report.html").is_file()
    assert os.fspath(study / "report.html") in printed


def test_command_says_what_is_missing(tmp_path, capsys):
    assert main([str(tmp_path / "none")]) == 1
    assert "no such folder" in capsys.readouterr().err
    with pytest.raises(CospeechError, match=r"no record\.json"):
        collect(tmp_path)
