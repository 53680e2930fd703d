"""Advice can be followed: what messages, comments and READMEs tell to type exists."""

from functools import cache

import pytest

from tests.advice import Known, Text, faults, texts, texts_of_code

OF_OTHERS = {"input_context": "a setting of the published code, named in what its checkpoint says"}

ADDED = {
    ("docs/how_to/add_a_corpus.md", "data=positions"),
    ("docs/how_to/add_a_metric.md", "metrics=mine"),
}
"""What a page adds itself, and names."""


@cache
def known() -> Known:
    return Known()


@cache
def everything() -> list[Text]:
    return list(texts())


def test_everything_that_is_advised_exists():
    read = everything()
    found = [
        f"{text.place}: {fault}"
        for text in read
        for fault in faults(text, known())
        if fault.partition("=")[0] not in OF_OTHERS
        and (text.place.partition(":")[0], fault.partition(":")[0]) not in ADDED
    ]
    assert found == []
    # Nothing is found in nothing.
    assert sum(text.is_hint for text in read) > 200
    assert sum("data." in text.text and "=" in text.text for text in read) > 40
    assert sum("python train.py" in text.text for text in read) > 20


def message(source: str) -> list[str]:
    return [fault for text in texts_of_code(source, "src/x.py") for fault in faults(text, known())]


@pytest.mark.parametrize(
    ("source", "fault"),
    [
        ("raise ConfigError('x', 'say data.no_such=1')", "data.no_such=1"),
        ("raise ConfigError(f'{a}: say model.no_such={a}')", "model.no_such={"),
        ("raise ConfigError('x', 'add frame_rate=30')", "frame_rate=30"),  # no such top-level one
        ("raise ConfigError('x', f'add {a}' ' or model.hiden_size=3')", "model.hiden_size=3"),
        ("raise ConfigError('x', setting('data.no_such', a))", "data.no_such={"),
        ("raise ConfigError('x', f'say {setting(\"data.no_such\", a)}')", "data.no_such={"),
        ("raise InputFileError(p, 'x', None, 'say no_such=1')", "no_such=1"),
        ("raise InputFileError(p, 'x', hint='say no_such=1')", "no_such=1"),
        ("log('no_such_thing=1 is wrong')", "no_such_thing=1"),
        ("log('python train.py model=trimodl')", "model=trimodl"),
        ("log('python train.py run=x')", "run=x"),  # evaluate.py has it
        ("log('python prepare.py model=knn')", "model=knn"),
        ("log('python transform.py model=knn')", "transform.py"),
        ("log('ablation=trimodal__no_sound')", "ablation=trimodal__no_sound"),
        ("log('python -m cospeech.corpse doctor DIR')", "cospeech.corpse"),
        ("log('python -m cospeech.corpus nurse DIR')", "nurse"),
        ("log('python -m cospeech.corpus doctor DIR --jason x')", "--jason"),
        ("raise ConfigError('x', 'give it with --adio')", "--adio"),
        ("log(\"pip install -e '.[nothing]'\")", "nothing"),
        ("log('see docs/absent.md')", "docs/absent.md"),
        ("log('conf/modl/NAME.yaml or conf/modl/x.yaml')", "conf/modl/x.yaml"),
        ("log('read_bvh(path, frame_rat=30)')", "frame_rat=30"),
        ("log('read_bvh(path, minutes=30)')", "minutes=30"),  # another function's argument
    ],
)
def test_advice_that_cannot_be_followed_is_found(source, fault):
    assert fault in " ".join(message(source))


@pytest.mark.parametrize(
    "source",
    [
        "raise ConfigError('x', 'say data.frame_rate=30, or read_bvh(path, frame_rate=30)')",
        "raise ConfigError('x', '+trainer.fast_dev_run=true or training.batch_size=16')",
        "log('python train.py model=trimodal data=mocap data.root=DIR debug=fast')",
        "log('python evaluate.py study=fgd_noise, or run=outputs/runs/ID')",
        "log('python -m cospeech.corpus doctor DIR --json FILE')",
        "log('model=NAME ablation={a},{b} experiment=...')",
        'log(\'<rect x="1" width="3"/>\')',
        "log(\"pip install -e '.[mlflow,video]'\")",
    ],
)
def test_advice_that_can_be_followed_is_not(source):
    assert message(source) == []


def test_comments_and_readmes_are_read_too():
    places = {text.place.partition(":")[0] for text in everything()}
    assert {"README.md", "conf/train.yaml", "train.py", "data_modules/mocap.py"} <= places
    assert any(place.endswith("methods/motion_matching/README.md") for place in places)
    assert faults(Text("conf/x.yaml:1", " use data.no_such=1", False), known())
