"""``python -m cospeech.corpus doctor PATH``: is anything wrong with this corpus?"""

from __future__ import annotations

import argparse
import json
import logging
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from cospeech.terminal import exit_status, number_between, stop_at_once

if __name__ == "__main__":
    stop_at_once()

from cospeech.doctor import LAYOUTS, ReadingSettings, check_path, has_errors, text_report
from cospeech.errors import CospeechError
from cospeech.files import behind_links, require_replaceable, write_text
from cospeech.motion.bvh import UP_AXES
from cospeech.motion.joint_map import load_joint_map
from cospeech.motion.joint_map_values import UNIT_SCALES
from cospeech.motion.phases import PHASES


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; the exit status: 1 for errors in the data, 2 when it could not be looked at.

    Args:
        arguments: Command line; that of the process when None.
    """
    given = _parser().parse_args(arguments)
    # What readers warn of is among the findings.
    log = logging.getLogger("cospeech")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        if given.json is not None:
            require_replaceable(given.json)  # before hours of looking
        joint_map = None if given.joint_map is None else load_joint_map(given.joint_map)
        checkup = check_path(
            given.path,
            layout=given.layout,
            settings=ReadingSettings(
                joint_map=joint_map,
                frame_rate=given.frame_rate,
                unit_scale=given.unit_scale,
                up_axis=given.up_axis,
                phase_tier=given.phase_tier,
                phase_labels=dict(given.phase_label),
            ),
            limit=given.limit,
            by_speakers=given.by_speakers,
            workers=given.workers,
        )
        if given.json is not None:
            write_text(behind_links(given.json), json.dumps(checkup.to_dict(), indent=1))
    except CospeechError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    finally:
        log.setLevel(level)
    print(text_report(checkup))
    return int(has_errors(checkup.findings))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m cospeech.corpus")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    doctor = commands.add_parser(
        "doctor",
        help="look for faults in a raw folder or a prepared store",
        description="Look for faults in a raw folder or a prepared store. Nothing is changed.",
    )
    doctor.add_argument("path", type=Path, help="the folder that data.root names, or a store")
    names = [layout.name for layout in LAYOUTS]
    doctor.add_argument("--layout", choices=names, help="read the folder as this (by its names)")
    doctor.add_argument("--limit", type=_positive, metavar="N", help="look at N takes or sources")
    doctor.add_argument(
        "--by-speakers", action="store_true", help="held-out splits must have speakers of their own"
    )
    doctor.add_argument("--joint-map", metavar="MAP", help="name or yaml of a joint map")
    doctor.add_argument("--frame-rate", type=_above_zero, metavar="FPS", help="rate of BVH rows")
    doctor.add_argument(
        "--unit-scale",
        type=number_between(*UNIT_SCALES),
        metavar="METRES",
        help="metres per unit of BVH files",
    )
    doctor.add_argument(
        "--up-axis", choices=UP_AXES, default="y", help="vertical axis of BVH files"
    )
    doctor.add_argument("--phase-tier", metavar="TIER", help="tier of gesture phases")
    doctor.add_argument(
        "--phase-label",
        type=_label,
        action="append",
        default=[],
        metavar="TEXT=PHASE",
        help="what a label of the annotations means; may be given several times",
    )
    doctor.add_argument("--workers", type=_positive, metavar="N", help="processes (one per core)")
    doctor.add_argument("--json", type=Path, metavar="FILE", help="write all findings there")
    return parser


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return value


def _above_zero(text: str) -> float:
    value = float(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError("a number above 0")
    return value


def _label(text: str) -> tuple[str, str]:
    label, equals, phase = text.rpartition("=")
    if not equals or phase not in PHASES:
        raise argparse.ArgumentTypeError(f"TEXT=PHASE, of the phases {', '.join(PHASES)}")
    return label, phase


if __name__ == "__main__":
    sys.exit(exit_status(main))
