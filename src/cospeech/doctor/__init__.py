"""The doctor: what is wrong with a corpus, before anybody trains on it."""

from cospeech.doctor.checkup import Checkup, check_path
from cospeech.doctor.corpus import compare
from cospeech.doctor.examination import Examination, examine, examine_closely
from cospeech.doctor.findings import Check, Files, Finding, Severity, has_errors
from cospeech.doctor.gate import examined_source
from cospeech.doctor.layouts import LAYOUTS
from cospeech.doctor.report import text_report
from cospeech.formats.mocap import ReadingSettings

__all__ = [
    "LAYOUTS",
    "Check",
    "Checkup",
    "Examination",
    "Files",
    "Finding",
    "ReadingSettings",
    "Severity",
    "check_path",
    "compare",
    "examine",
    "examine_closely",
    "examined_source",
    "has_errors",
    "text_report",
]
