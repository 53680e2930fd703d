"""A checkup as text for the terminal."""

from __future__ import annotations

import textwrap
from collections import defaultdict

from cospeech.doctor.checkup import Checkup
from cospeech.doctor.findings import Check, Finding, Severity

SHOWN_PER_CHECK = {Severity.ERROR: 10, Severity.WARNING: 10, Severity.NOTE: 2}
"""Findings of one check that are printed in full."""

_WIDTH = 100


def text_report(checkup: Checkup) -> str:
    """Findings by check, errors first, and a sum at the end."""
    groups: dict[tuple[Severity, Check], list[Finding]] = defaultdict(list)
    for finding in checkup.findings:
        groups[finding.severity, finding.check].append(finding)
    lines: list[str] = []
    for (severity, check), findings in groups.items():
        shown = SHOWN_PER_CHECK[severity]
        lines.append(f"{severity.upper()}  {check}  ({len(findings)})")
        for finding in findings[:shown]:
            where = "" if finding.time_s is None else f", at {finding.time_s:.2f} s"
            lines.append(f"  {finding.file}{where}")
            lines += _wrapped(finding.problem, "      ", "      ")
            lines += _wrapped(finding.next_step, "      -> ", "         ")
        if len(findings) > shown:
            lines.append(f"  ... and {len(findings) - shown} more; --json FILE keeps all of them")
        lines.append("")
    for reason, count in checkup.left_out.items():
        lines.append(f"left out by the corpus's own rules: {count} ({reason})")
    counts = {
        severity: sum(finding.severity is severity for finding in checkup.findings)
        for severity in Severity
    }
    lines.append(
        f"{checkup.path} ({checkup.layout}): {checkup.recordings} recordings,"
        f" {_duration(checkup.seconds)}; {counts[Severity.ERROR]} errors,"
        f" {counts[Severity.WARNING]} warnings, {counts[Severity.NOTE]} notes"
    )
    return "\n".join(lines)


def _wrapped(text: str, first: str, later: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent=first, subsequent_indent=later)


def _duration(seconds: float) -> str:
    return f"{seconds / 3600:.1f} h" if seconds >= 3600 else f"{seconds / 60:.1f} min"
