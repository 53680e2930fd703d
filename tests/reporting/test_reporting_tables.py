import math

import pytest

from cospeech.reporting.tables import Column, format_table, format_value, result_table, summarise


def test_summary_against_hand_computed_numbers():
    summary = summarise([1.0, 2.0, 6.0])
    assert summary is not None
    assert summary.mean == 3.0
    # squares 4 + 1 + 9 = 14, over n - 1 = 2
    assert summary.std == pytest.approx(math.sqrt(7))
    # t(0.975, 2) = 4.302653 from a printed table
    half = 4.302653 * math.sqrt(7) / math.sqrt(3)
    assert summary.ci95 == pytest.approx((3 - half, 3 + half), abs=1e-5)
    assert str(summary) == "3.0 ± 2.6"


def test_summary_of_one_and_of_none():
    one = summarise([0.123456])
    assert one is not None
    assert (one.std, one.ci95, str(one)) == (None, None, "0.1235")
    assert summarise([]) is None
    assert summarise([math.nan, math.inf]) is None


def test_spread_decides_the_digits():
    assert str(summarise([3.2101, 3.2139, 3.2120])) == "3.2120 ± 0.0019"
    assert str(summarise([1200.0, 1500.0])) == "1350 ± 212"
    assert str(summarise([2.5, 2.5])) == "2.500 ± 0.000"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "\N{EN DASH}"),
        (3, "3"),
        (3.0, "3"),
        (0.012345, "0.01235"),
        (12.34567, "12.35"),
        (12345.67, "12346"),
        (0.00001234, "1.23e-05"),
        (math.nan, "nan"),
        (True, "yes"),
        ("text", "text"),
    ],
)
def test_values(value, text):
    assert format_value(value) == text


def test_text_table():
    rows = [{"name": "a", "fgd": 1.5}, {"name": "longer", "fgd": 10.25, "n": 3}]
    columns = [Column("name", "method"), Column("fgd", "FGD", "lower"), "n"]
    assert format_table(rows, columns).split("\n") == [
        "method  FGD ↓  n",
        "──────  ─────  ─",
        "a       1.500  \N{EN DASH}",
        "longer  10.25  3",
    ]


def test_markdown_table_escapes_and_aligns():
    rows = [{"a|b": "x|y\nz", "n": 2}]
    assert format_table(rows, style="markdown").split("\n") == [
        "| a\\|b | n |",
        "| --- | ---: |",
        "| x\\|y z | 2 |",
    ]


def test_result_table_puts_reference_rows_below_the_run():
    record = {
        "model": "trimodal",
        "seed": 4,
        "encoder": {"sha256": "abcdef0123456789", "name": "own"},
        "final": {
            "split": "test",
            "windows": {"fgd": 2.5, "joint_mae": 0.031},
            "recordings": {"fgd": 3.5, "fgd_low": 3.0, "fgd_high": 4.25, "windows": 120.0},
        },
        "references": {"real_halves": {"fgd": 0.125}, "mismatched": {"joint_mae": 0.07}},
    }
    lines = result_table(record).split("\n")
    assert lines[0].split("  ")[0] == ""
    names = [line[:21].strip() for line in lines[2:6]]
    assert names == ["trimodal (windows)", "trimodal (recordings)", "real halves", "mismatched"]
    assert "3 to 4.250" in lines[3]
    assert lines[-1] == "split: test · seed: 4 · encoder: own abcdef012345 · windows: 120"


@pytest.mark.parametrize(
    "record", [{}, {"final": None, "references": []}, {"final": {"windows": 3}}]
)
def test_result_table_of_an_unfinished_record(record):
    assert "seed" in result_table(record)
