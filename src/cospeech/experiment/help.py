"""What ``--help`` answers: examples, groups with their choices, settings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

from hydra.errors import HydraException
from omegaconf import OmegaConf, open_dict

from cospeech.experiment.typed import Command

_WIDTH = 100

_OPTIONS = """\
Options:
  -m, --multirun        a run for each of several values: seed=0,1,2
  -c job                show the settings and run nothing (--cfg)
  --info defaults       which yaml files the settings come from
  --hydra-help          all options of Hydra"""


def help_text(command: Command, overrides: Sequence[str]) -> str:
    """The answer, with the settings that the given choices have."""
    lines = [*_comments(command.conf / f"{command.name}.yaml"), ""]
    groups = command.groups()
    if groups:
        lines.append("Groups, chosen with group=choice:")
        width = max(len(group) for group in groups)
        for group in groups:
            text = f"  {group:{width}}  {', '.join(command.choices(group))}"
            indent = " " * (width + 4)
            lines.append(fill(text, _WIDTH, subsequent_indent=indent, break_long_words=False))
        lines.append("")
    lines += [*_settings(command, overrides), "", _OPTIONS]
    return "\n".join(lines)


def _comments(path: Path) -> list[str]:
    """The lines of comment that a yaml begins with."""
    found = list[str]()
    for line in path.read_text().splitlines():
        if not line.startswith("#"):
            break
        found.append(line.removeprefix("#").strip())
    return found


def _settings(command: Command, overrides: Sequence[str]) -> list[str]:
    try:
        cfg = command.compose(overrides)
    except HydraException:
        lacking = command.groups()[0]
        return [
            "Settings, changed with name=value: those of a choice are shown by"
            f" python {command.name}.py {lacking}=NAME --help"
        ]
    with open_dict(cfg):
        del cfg["hydra"]
    shown = OmegaConf.to_yaml(cfg).rstrip().splitlines()
    return ["Settings, changed with name=value (group.name=value):", *(f"  {s}" for s in shown)]
