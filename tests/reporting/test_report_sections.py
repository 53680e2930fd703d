"""What the report sets apart: corpora and encoders, debug, killed and running runs; its links."""

import json
import os
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from filelock import FileLock

from cospeech.reporting.__main__ import main
from cospeech.reporting.collect import collect
from cospeech.reporting.grouping import group_runs
from cospeech.reporting.report import text_report, write_report
from cospeech.reporting.results import results_of
from tests.reporting.records import record

REFERENCES = {
    "real_halves": {"fgd": 3.004},
    "mean_pose": {"fgd": 13.7, "fgd_low": 11.04, "fgd_high": 17.03},
}
OTHER = {"sha256": "encoder-2", "name": "published"}


class Page(HTMLParser):
    """Tables as rows of texts, each under its last heading, and links."""

    def __init__(self, text):
        super().__init__()
        self.tables, self.links, self.headings = [], [], []
        self._in = None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        if tag == "a":
            self.links.append(dict(attributes)["href"])
        if tag == "table":
            self.tables.append((self.headings[-1], []))
        if tag == "tr":
            self.tables[-1][1].append([])
        if tag in ("td", "th"):
            self.tables[-1][1][-1].append("")
        if tag == "h2":
            self.headings.append("")
        if tag in ("td", "th", "h2"):
            self._in = tag
        if tag in ("small", "h3"):
            self._in = None

    def handle_endtag(self, tag):
        if tag in ("td", "th", "h2"):
            self._in = None

    def handle_data(self, data):
        if self._in == "h2":
            self.headings[-1] += data
        elif self._in:
            self.tables[-1][1][-1][-1] += data


@pytest.fixture
def runs(tmp_path):
    folder = tmp_path / "runs"
    folder.mkdir()
    final = {"windows": {"fgd": 2.0}, "recordings": {"fgd": 4.5, "fgd_low": 1.4, "fgd_high": 6.2}}
    for ablation in ("full", "trimodal__no_text"):
        record(folder, 0, ablation, final=final, references=REFERENCES)
    record(folder, 1, final=final, references=REFERENCES)
    record(folder, 0, final=final, references=REFERENCES, encoder=OTHER)
    record(folder, 0, final=final, references=REFERENCES, data="mocap", data_fingerprint="corpus-2")
    return folder


def test_a_reference_is_of_the_newest_run_that_has_it(tmp_path):
    """Of one corpus, encoder and draw of the rows, whatever the metrics of each run."""
    titles = [{"key": key, "title": key, "better": None} for key in ("fgd", "silence", "pause")]

    def run(hour, seed, values, drawn=0, **more):
        record(
            tmp_path,
            seed,
            finished=f"2026-01-01T{hour:02}:00:00+00:00",
            references={"noise": values},
            metrics=titles[: len(values)],
            config={"metrics": {"reference_seed": drawn}},
            **more,
        )

    run(1, 0, {"fgd": 1.0, "silence": 1.0, "pause": 1.0})
    run(2, 1, {"fgd": 2.0, "silence": 2.0, "fgd_low": 1.5, "fgd_high": 2.5})
    run(3, 2, {"fgd": 3.0})
    run(4, 3, {"fgd": 4.0, "silence": 4.0, "pause": 4.0}, encoder=OTHER)
    run(0, 4, {"fgd": 5.0, "silence": 5.0, "pause": 5.0}, drawn=1)
    newest, other = sorted(
        (r.rows[-1] for r in results_of(group_runs(collect(tmp_path).runs))),
        key=lambda row: row["fgd"],
    )
    assert [newest[key] for key in ("fgd", "silence", "pause")] == [3.0, 2.0, 1.0]
    assert newest["interval"] is None  # an older code's
    assert [other[key] for key in ("fgd", "silence", "pause")] == [4.0, 4.0, 4.0]


def test_a_reference_of_another_draw_is_not_taken(tmp_path):
    titles = [{"key": key, "title": key, "better": None} for key in ("fgd", "silence")]
    for hour, values in ((1, {"fgd": 1.0, "silence": 1.0}), (2, {"fgd": 2.0})):
        record(
            tmp_path,
            hour,
            finished=f"2026-01-01T{hour:02}:00:00+00:00",
            references={"noise": values},
            metrics=titles,
            config={"metrics": {"reference_seed": hour}},
        )
    (results,) = results_of(group_runs(collect(tmp_path).runs))
    assert (results.rows[-1]["fgd"], results.rows[-1]["silence"]) == (2.0, None)


def page_of(folder):
    return Page(write_report(collect(folder), folder / "report.html").read_text())


def result_tables(page):
    return [(heading, rows) for heading, rows in page.tables if rows[0][1:2] == ["protocol"]]


def test_a_table_is_of_one_corpus_and_one_encoder_and_names_both(runs):
    tables = result_tables(page_of(runs))
    assert [heading for heading, _ in tables] == [
        "Corpus mocap corpus-2 · encoder own encoder-1",
        "Corpus synthetic corpus-1 · encoder own encoder-1",
        "Corpus synthetic corpus-1 · encoder published encoder-2",
    ]
    text = text_report(collect(runs))
    assert all(text.count(f"{heading}\n") == 1 for heading, _ in tables)


def test_reference_rows_stand_once_in_each_table(runs):
    for _, rows in result_tables(page_of(runs)):
        names = [row[0].strip() for row in rows]
        assert names.count("mean pose") == names.count("real halves") == 1
    assert text_report(collect(runs)).count("mean pose") == 3


def test_intervals_stand_where_the_run_printed_them(runs):
    rows = result_tables(page_of(runs))[1][1]
    heads = rows[0]
    assert heads[3:5] == ["FGD ↓", "95 % over recordings"]
    cells = {(row[0].strip(), row[1]): row[4] for row in rows[1:]}
    assert cells["trimodal, no text", "recordings"] == "1.400 to 6.200"
    assert cells["trimodal, no text", "windows"] == "\N{EN DASH}"
    assert cells["mean pose", "reference"] == "11.04 to 17.03"
    # of several seeds, each run has its own
    own = [rows for _, rows in page_of(runs).tables if rows[0][0] == "run"][1]
    assert [row[4] for row in own[1:]] == ["1.400 to 6.200"] * 3


def test_terminal_and_page_show_the_same(runs):
    printed = text_report(collect(runs), "markdown")
    on_page = result_tables(page_of(runs))
    lines = [line for line in printed.split("\n") if line.startswith("|") and "---" not in line]
    assert len(lines) == sum(len(rows) for _, rows in on_page)
    told = [[cell.replace("\\", "").strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert told == [[cell.strip() for cell in row] for _, rows in on_page for row in rows]


@pytest.mark.parametrize(
    "trainer",
    [{"limit_train_batches": 2}, {"limit_test_batches": 0.1}, {"fast_dev_run": True}],
)
def test_debug_runs_are_no_results(runs, trainer):
    config = {"trainer": trainer, "model": {"width": 8}}
    run = record(runs, 7, id="quick look", config=config, final={"windows": {"fgd": 77.125}})
    page = page_of(runs)
    assert run.name + "/" in page.links
    assert "77.13" not in str(result_tables(page))
    assert any("quick look" in str(rows) for title, rows in page.tables if title == "Debug runs")
    text = text_report(collect(runs))
    assert "77.13" not in text
    assert re.search(r"Debug runs, not among the results:\nquick look: ok", text)


@pytest.mark.parametrize("trainer", [{"limit_val_batches": 1.0}, {"limit_train_batches": None}])
def test_a_whole_epoch_is_no_debug_run(runs, trainer):
    record(runs, 7, config={"trainer": trainer})
    assert not any(run.is_debug for run in collect(runs).runs)


def test_failed_and_interrupted_runs_are_apart(runs):
    record(runs, 5, status="failed", error="ValueError: NaN", final={"windows": {"fgd": 88.5}})
    record(runs, 6, status="interrupted", error="stopped by Ctrl-C")
    page = page_of(runs)
    assert "88.5" not in str(page.tables)
    (rows,) = [rows for title, rows in page.tables if title == "Failed and interrupted runs"]
    assert [row[1] for row in rows[1:]] == ["failed", "interrupted"]
    assert "s5: failed: ValueError: NaN\n" in text_report(collect(runs))


def tree(folder):
    return {path: path.lstat().st_mtime_ns for path in sorted(folder.rglob("*"))}


def test_a_run_whose_process_is_gone_is_interrupted_and_one_at_work_is_running(runs):
    killed, alive = (record(runs, seed, status="running", final={}) for seed in (8, 9))
    FileLock(str(killed / ".lock")).acquire().lock.release()
    with FileLock(str(alive / ".lock")):
        before = tree(runs)
        found = {run.folder: run for run in collect(runs).runs}
        assert (found[killed].status, found[alive].status) == ("interrupted", "running")
        assert tree(runs) == before
        text = text_report(collect(runs))
    assert "s8: interrupted: killed" in text
    assert re.search(r"Still running, not among the results:\n\S+s9: running\n", text)
    # the report holds no lock that a run would have to wait for
    for run in (killed, alive):
        FileLock(str(run / ".lock")).acquire(timeout=0).lock.release()
    assert next(r for r in collect(runs).runs if r.folder == alive).status == "interrupted"


def test_without_a_lock_nobody_can_tell(runs):
    run = record(runs, 8, status="running", final={})
    assert next(r for r in collect(runs).runs if r.folder == run).status == "running?"
    (run / ".lock").symlink_to(run / "record.json")
    assert "s8: running?" in text_report(collect(runs))
    (run / ".lock").unlink()
    os.mkfifo(run / ".lock")  # opened as files are, it would wait for a writer
    assert "trimodal-synthetic-full-s8" in text_report(collect(runs))


def test_links_lead_to_what_they_name(runs, tmp_path, monkeypatch):
    run = record(runs, 3, samples=["samples/a b#c?d%41.html"])
    (run / "samples").mkdir()
    (run / "samples" / "a b#c?d%41.html").write_text("x")
    outside = tmp_path / "elsewhere"
    outside.mkdir()
    (runs / "linked").symlink_to(record(outside, 4), target_is_directory=True)
    (tmp_path / "short").symlink_to(runs)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deep" / "er").mkdir(parents=True)
    (tmp_path / "deep" / "er" / "far").symlink_to(runs)
    for folder, output in (
        ("runs/", None), ("./runs", None), (str(runs), None), ("short", None), ("short/", None),
        ("short", "page.html"), ("deep/../runs", "deep/er/page.html"), ("short", "short/../p.html"),
        ("deep/er/far", "deep/er/far/../p.html"),
    ):  # fmt: skip
        assert main([folder, *(["--output", output] if output else [])]) == 0
        path = Path(output or Path(folder) / "report.html")
        for opened in (path.absolute(), path.resolve()):
            page = Page(opened.read_text())
            assert len(page.links) == 8
            for link in page.links:
                parts = urlsplit(link)
                assert parts.path == link
                # as a browser does it: by the text of the address
                target = os.path.normpath(path.resolve().parent / unquote(link))
                assert Path(target).exists(), (folder, output, link)
        path.unlink()


def test_a_run_and_a_link_to_it_are_one(runs):
    run = next(runs.glob("*no_text*"))
    (runs / "0-first").symlink_to(run)
    (runs / "loop").symlink_to(runs)
    folders = [found.folder for found in collect(runs).runs]
    assert len(folders) == 5
    assert run in folders


def test_a_method_without_gestures_shows_its_own_numbers(tmp_path):
    record(tmp_path, encoder=None, final={"windows": {"accuracy": 0.75}}, references={})
    (results,) = results_of(group_runs(collect(tmp_path).runs))
    assert results.title == "Corpus synthetic corpus-1"
    assert [column.key for column in results.columns] == ["label", "protocol", "runs", "accuracy"]


def test_a_page_that_cannot_be_written_does_not_cost_the_table(runs, capsys):
    (runs / "report.html").mkdir()
    assert main([str(runs)]) == 1
    out, error = capsys.readouterr()
    assert "mean pose" in out
    assert error.startswith(f"error: {runs / 'report.html'}: can't be written (it is not a file)")
    assert [path.name for path in runs.glob(".*")] == []


def test_json_of_the_records_is_left_as_it_was(runs):
    before = {path: json.loads(path.read_text()) for path in runs.rglob("record.json")}
    page_of(runs)
    assert {path: json.loads(path.read_text()) for path in runs.rglob("record.json")} == before
