"""Gesture phases from annotation files, honest and hostile."""

import contextlib
import re
import shlex
import time

import pytest
import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.phase_files import PhaseSegment, frame_phases, read_phases
from cospeech.formats.phase_files.hands import BUSIEST_FIRST, are_hands, busier_hand
from cospeech.motion.phases import PHASES

ANVIL = """<?xml version="1.0" encoding="{encoding}"?>
<annotation>
  <head>
    <specification src="gesture_spec.xml"/>
    <video src="take_01.mov" master="true"/>
    <info key="coder" type="String">NN</info>
  </head>
  <body>
    <track name="gesture.phase" type="primary">
      <el index="0" start="0.52" end="1.04">
        <attribute name="type">prep</attribute>
      </el>
      <el index="1" start="1.04" end="1.64">
        <attribute name="type">Stroke</attribute>
        <attribute name="comment">big one</attribute>
      </el>
      <el index="2" start="1.64" end="2.2">
        <attribute name="type">post-stroke hold</attribute>
      </el>
    </track>
    <track name="gesture.phrase" type="span" ref="gesture.phase">
      <el index="0" start="0" end="2">
        <attribute name="handedness">both</attribute>
      </el>
    </track>
    <track name="speech.waveform" type="waveform"/>
  </body>
</annotation>
"""

PHASES_OF_BOTH = [
    PhaseSegment(0.52, 1.04, "preparation"),
    PhaseSegment(1.04, 1.64, "stroke"),
    PhaseSegment(1.64, 2.2, "hold"),
]

ELAN = """<?xml version="1.0" encoding="UTF-8"?>
<ANNOTATION_DOCUMENT AUTHOR="" DATE="2020-01-01T00:00:00+00:00" FORMAT="3.0" VERSION="3.0"
 xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
 xsi:noNamespaceSchemaLocation="http://www.mpi.nl/tools/elan/EAFv3.0.xsd">
  <HEADER MEDIA_FILE="" TIME_UNITS="milliseconds">
    <MEDIA_DESCRIPTOR MEDIA_URL="file:///take_01.mp4" MIME_TYPE="video/mp4"/>
  </HEADER>
  <TIME_ORDER>
    <TIME_SLOT TIME_SLOT_ID="ts1" TIME_VALUE="520"/>
    <TIME_SLOT TIME_SLOT_ID="ts2" TIME_VALUE="1040"/>
    <TIME_SLOT TIME_SLOT_ID="ts3" TIME_VALUE="1040"/>
    <TIME_SLOT TIME_SLOT_ID="ts4" TIME_VALUE="1640"/>
    <TIME_SLOT TIME_SLOT_ID="ts5" TIME_VALUE="1640"/>
    <TIME_SLOT TIME_SLOT_ID="ts6"/>
    <TIME_SLOT TIME_SLOT_ID="ts7"/>
    <TIME_SLOT TIME_SLOT_ID="ts8" TIME_VALUE="2200"/>
  </TIME_ORDER>
  <TIER LINGUISTIC_TYPE_REF="phase" TIER_ID="RH phase">
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a1" TIME_SLOT_REF1="ts1" TIME_SLOT_REF2="ts2">
      <ANNOTATION_VALUE>Prep</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a2" TIME_SLOT_REF1="ts3" TIME_SLOT_REF2="ts4">
      <ANNOTATION_VALUE>STROKE</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a3" TIME_SLOT_REF1="ts5" TIME_SLOT_REF2="ts8">
      <ANNOTATION_VALUE>hold</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
  </TIER>
  <TIER LINGUISTIC_TYPE_REF="text" TIER_ID="words">
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a4" TIME_SLOT_REF1="ts1" TIME_SLOT_REF2="ts8">
      <ANNOTATION_VALUE>well then</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
  </TIER>
  {more}
</ANNOTATION_DOCUMENT>
"""

SUBDIVIDED = """
<TIER LINGUISTIC_TYPE_REF="sub" TIER_ID="parts" PARENT_REF="words">
  <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="b1" TIME_SLOT_REF1="ts5" TIME_SLOT_REF2="ts6">
    <ANNOTATION_VALUE>hold</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
  <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="b2" TIME_SLOT_REF1="ts6" TIME_SLOT_REF2="ts7">
    <ANNOTATION_VALUE>partial retraction</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
  <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="b3" TIME_SLOT_REF1="ts7" TIME_SLOT_REF2="ts8">
    <ANNOTATION_VALUE>rest</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
</TIER>
"""

REFERRING = """
<TIER LINGUISTIC_TYPE_REF="sub" TIER_ID="grandchildren" PARENT_REF="children">
  <ANNOTATION><REF_ANNOTATION ANNOTATION_ID="d1" ANNOTATION_REF="c2">
    <ANNOTATION_VALUE>recovery</ANNOTATION_VALUE></REF_ANNOTATION></ANNOTATION>
</TIER>
<TIER LINGUISTIC_TYPE_REF="sub" TIER_ID="children" PARENT_REF="RH phase">
  <ANNOTATION><REF_ANNOTATION ANNOTATION_ID="c1" ANNOTATION_REF="a2">
    <ANNOTATION_VALUE>up</ANNOTATION_VALUE></REF_ANNOTATION></ANNOTATION>
  <ANNOTATION><REF_ANNOTATION ANNOTATION_ID="c2" ANNOTATION_REF="a2" PREVIOUS_ANNOTATION="c1">
    <ANNOTATION_VALUE>down</ANNOTATION_VALUE></REF_ANNOTATION></ANNOTATION>
</TIER>
"""


def write(folder, name: str, text: str, encoding: str = "utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def elan(folder, more: str = "", **replaced: str):
    text = ELAN.replace("{more}", more)
    for old, new in replaced.items():
        text = text.replace(old, new)
    return write(folder, "take.eaf", text)


# ANVIL -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_anvil_in_the_encodings_it_is_written_in(tmp_path, encoding):
    path = write(tmp_path, "take.anvil", ANVIL.format(encoding=encoding), encoding)
    assert read_phases(path) == PHASES_OF_BOTH


def test_anvil_attribute_and_track_can_be_named(tmp_path):
    path = write(tmp_path, "take.anvil", ANVIL.format(encoding="utf-8"))
    assert read_phases(path, "gesture.phase:type") == PHASES_OF_BOTH
    assert read_phases(path, "gesture.phase") == PHASES_OF_BOTH


def test_anvil_span_tracks_take_the_times_of_the_elements_they_name(tmp_path):
    path = write(tmp_path, "take.anvil", ANVIL.format(encoding="utf-8"))
    phrase = read_phases(path, "gesture.phrase:handedness", {"both": "stroke"})
    assert phrase == [PhaseSegment(0.52, 2.2, "stroke")]


def test_anvil_reference_to_a_missing_element(tmp_path):
    broken = ANVIL.format(encoding="utf-8").replace('start="0" end="2"', 'start="0" end="7"')
    with pytest.raises(InputFileError, match=r"gesture\.phrase, element 0.*'7'.*has 3"):
        read_phases(write(tmp_path, "take.anvil", broken))


def test_anvil_tracks_that_refer_to_one_another(tmp_path):
    body = "".join(
        f'<track name="{a}" type="span" ref="{b}"><el index="0" start="0" end="0">'
        '<attribute name="type">stroke</attribute></el></track>'
        for a, b in (("one", "two"), ("two", "one"))
    )
    path = write(tmp_path, "t.anvil", f"<annotation><body>{body}</body></annotation>")
    with pytest.raises(InputFileError, match="can't be followed"):
        read_phases(path, "one")


# ELAN --------------------------------------------------------------------------------------------


def test_elan(tmp_path):
    assert read_phases(elan(tmp_path)) == PHASES_OF_BOTH
    assert read_phases(elan(tmp_path), "RH phase") == PHASES_OF_BOTH


def test_elan_slots_that_nobody_aligned_are_spread_evenly(tmp_path):
    parts = read_phases(elan(tmp_path, SUBDIVIDED), "parts")
    edges = [1.64, 1.64 + 0.56 / 3, 1.64 + 2 * 0.56 / 3, 2.2]
    assert [part.label for part in parts] == ["hold", "partial_retract", "rest_hold"]
    assert [part.start_s for part in parts] == pytest.approx(edges[:-1])
    assert [part.end_s for part in parts] == pytest.approx(edges[1:])


def test_elan_annotations_that_refer_to_others_share_their_time(tmp_path):
    labels = {"up": "preparation", "down": "stroke"}
    path = elan(tmp_path, REFERRING)
    children = read_phases(path, "children", labels)
    assert [child.label for child in children] == ["preparation", "stroke"]
    times = [time for child in children for time in (child.start_s, child.end_s)]
    assert times == pytest.approx([1.04, 1.34, 1.34, 1.64])
    (grandchild,) = read_phases(path, "grandchildren")
    assert grandchild == PhaseSegment(children[1].start_s, children[1].end_s, "retract")


def test_elan_tier_without_times(tmp_path):
    path = elan(tmp_path, REFERRING.replace('ANNOTATION_REF="a2"', 'ANNOTATION_REF="gone"'))
    with pytest.raises(InputFileError, match=r"children.*annotation c1 has no place in time"):
        read_phases(path, "children")
    assert read_phases(path, "RH phase") == PHASES_OF_BOTH


def test_elan_other_time_units_are_refused(tmp_path):
    with pytest.raises(InputFileError, match="PAL-frames"):
        read_phases(elan(tmp_path, milliseconds="PAL-frames"))


def test_elan_two_annotations_with_one_id(tmp_path):
    with pytest.raises(InputFileError, match="id of their own"):
        read_phases(elan(tmp_path, a4="a3"))


# Tables ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "0.52,1.04,preparation\n1.04,1.64,stroke\n1.64,2.2,hold\n",
        "start,end,label\n0.52,1.04,prep\n\n1.04,1.64,STROKE\n1.64,2.2,hold",
        "\ufeffLabel;Start;End;note\r\nprep;0.52;1.04;x\r\nstroke;1.04;1.64;\r\nhold;1.64;2.2;y\r\n",
        "Onset\tOffset\tPhase\n1.64\t2.2\thold\n0.52\t1.04\tprep\n1.04\t1.64\tstroke\n",
    ],
    ids=["bare", "header", "semicolons", "tabs"],
)
def test_tables(tmp_path, text):
    assert read_phases(write(tmp_path, "take.csv", text)) == PHASES_OF_BOTH


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,1\n", r"line 1: 2 columns"),
        ("0,1,stroke\n1,soon,hold\n", r"line 2: 'soon' is not a time"),
        ("0,1,stroke\nnan,2,hold\n", r"line 2: 'nan' is not a time"),
        ("begin,until,label\n0,1,hold\n", r"line 1: .*no column 'end'"),
        ("2,1,stroke\n", r"line 1: ends at 1 s, before it starts at 2 s"),
        ("", "is empty"),
        ("0,1,\n", "no annotation"),
        ("0,1,\xff\n", "UTF-8"),
    ],
)
def test_tables_that_make_no_sense(tmp_path, text, message):
    path = write(tmp_path, "take.csv", text, "latin-1")
    with pytest.raises(InputFileError, match=message):
        read_phases(path)


# Labels ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "label"),
    [
        ("Preparação", "preparation"),
        ("Preparac\u0327a\u0303o", "preparation"),
        ("PREP", "preparation"),
        ("pre-stroke hold", "pre_hold"),
        ("Pre_Hold", "pre_hold"),
        (" Stroke ", "stroke"),
        ("Post-Stroke Hold", "hold"),
        ("independent  hold", "independent_hold"),
        ("stroke hold", "independent_hold"),
        ("Rest position", "rest_hold"),
        ("Descanso", "rest_hold"),
        ("partial-retraction", "partial_retract"),
        ("Retração", "retract"),
        ("recovery", "retract"),
        ("no gesture", "none"),
        *((phase, phase) for phase in PHASES),
    ],
)
def test_what_the_literature_calls_the_phases(tmp_path, text, label):
    assert read_phases(write(tmp_path, "t.csv", f"0,1,{text}")) == [PhaseSegment(0.0, 1.0, label)]


def test_an_unknown_label_names_the_known_ones_and_a_mapping_mends_it(tmp_path):
    path = write(tmp_path, "t.csv", "0,1,P\n1,2,wobble\n2,2,stroke\n3,4,\n")
    with pytest.raises(
        InputFileError,
        match=r"(?s)line 1: 'P' is not.*independent_hold.*'data\.phase_labels=\{p: str",
    ):
        read_phases(path)
    own = {"p": "preparation", "Wobble": "independent_hold"}
    # An annotation without length and one without a label are no phases.
    assert read_phases(path, labels=own) == [
        PhaseSegment(0.0, 1.0, "preparation"),
        PhaseSegment(1.0, 2.0, "independent_hold"),
    ]
    with pytest.raises(CospeechError, match=r"'wobbling'.*preparation"):
        read_phases(path, labels={"P": "wobbling"})


@pytest.mark.parametrize("text", ["?", "--", "!", "¿?", "12", "null b", "inf"])
def test_a_label_of_marks_alone_can_be_given_a_meaning(tmp_path, text):
    path = write(tmp_path, "t.csv", f"0,1,{text}\n1,2,stroke\n")
    with pytest.raises(InputFileError, match="is not a gesture phase") as caught:
        read_phases(path)
    (given,) = typed(caught.value, "phase_labels") or [
        yaml.safe_load(caught.value.hint.split("phase_labels: ")[1].split(" in ")[0])
    ]
    assert given == {text: "stroke"}
    assert read_phases(path, labels=given) == [
        PhaseSegment(0.0, 1.0, "stroke"),
        PhaseSegment(1.0, 2.0, "stroke"),
    ]


def test_a_users_meaning_goes_before_the_known_one(tmp_path):
    path = write(tmp_path, "t.csv", "0,1,rest\n")
    assert read_phases(path, labels={"Rest": "none"}) == [PhaseSegment(0.0, 1.0, "none")]


def typed(error, key: str):
    """What a shell and Hydra make of the settings that an error's hint names."""
    quoted = re.findall(r"'data\.[^']+'|data\.\w+=\w+", error.hint)
    parsed = OverridesParser.create().parse_overrides([shlex.split(one)[0] for one in quoted])
    return [one.value() for one in parsed if one.key_or_group == f"data.{key}"]


HANDS = """
<TIER LINGUISTIC_TYPE_REF="sub" TIER_ID="LH phase">
  <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="e1" TIME_SLOT_REF1="ts1" TIME_SLOT_REF2="ts3">
    <ANNOTATION_VALUE>stroke</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
  <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="e2" TIME_SLOT_REF1="ts3" TIME_SLOT_REF2="ts8">
    <ANNOTATION_VALUE>retraction</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
</TIER>
"""


def test_of_a_tier_per_hand_the_busier_hand_counts(tmp_path):
    path = elan(tmp_path, HANDS)
    # the right hand: preparation 0.52-1.04, stroke 1.04-1.64, hold 1.64-2.2
    at = {0.6: "stroke", 1.0: "stroke", 1.3: "stroke", 1.7: "hold", 2.1: "hold", 2.3: "none"}
    labels = frame_phases(read_phases(path), 30, 10.0)
    assert {time: PHASES[labels[round(time * 10)]] for time in at} == at
    left = frame_phases(read_phases(path, "LH phase"), 30, 10.0)
    assert PHASES[left[17]] == "retract"


def test_time_of_one_hand_alone_keeps_its_label():
    left = [PhaseSegment(0.0, 2.0, "none"), PhaseSegment(0.5, 1.0, "stroke")]
    right = [PhaseSegment(1.5, 3.0, "retract")]
    labels = frame_phases(busier_hand([left, right]), 8, 2.0)
    expected = ("none", "stroke", "none", "retract", "retract", "retract", "none", "none")
    assert tuple(PHASES[label] for label in labels) == expected
    assert set(BUSIEST_FIRST) == set(PHASES)


@pytest.mark.parametrize(
    ("first", "second", "hands"),
    [
        ("phase_left", "phase_right", True),
        ("PhaseLeft", "PhaseRight", True),
        ("Hand (L)", "Hand (R)", True),
        ("A_phase_left", "B_phase_right", False),
        ("phase_left", "phase_left", False),
        ("left", "phase", False),
        ("linke Hand", "rechte Hand", True),
        ("main gauche", "main droite", True),
        ("RH phase", "BH phase", True),
    ],
)
def test_tiers_that_differ_by_left_and_right_alone_are_hands(first, second, hands):
    assert are_hands([first, second]) is hands


@pytest.mark.parametrize("names", [("left", "right", "both"), ("LH", "RH", ""), ("L", "R", "BH")])
def test_a_column_of_hands_is_a_tier_per_hand(tmp_path, names):
    left, right, both = names
    path = write(
        tmp_path,
        "t.phases.csv",
        f"start,end,label,hand\n0,2,retract,{left}\n0,1,stroke,{right}\n3,4,hold,{both}\n",
    )
    labels = frame_phases(read_phases(path), 4, 1.0)
    assert [PHASES[label] for label in labels] == ["stroke", "retract", "none", "hold"]
    (alone,) = read_phases(path, "left")
    assert alone == PhaseSegment(0.0, 2.0, "retract")
    path.write_text("start,end,label,hand\n0,2,stroke,open\n2,3,hold,fist\n")
    assert len(read_phases(path)) == 2


def test_the_origin_of_the_clock_of_the_media_file_is_added(tmp_path):
    media = '<MEDIA_DESCRIPTOR MEDIA_URL="file:///{}" MIME_TYPE="video/mp4" TIME_ORIGIN="{}"/>'
    start = PHASES_OF_BOTH[0].start_s

    def read(*descriptors):
        (told,) = re.findall(r"<MEDIA_DESCRIPTOR.*/>", ELAN)
        text = ELAN.replace("{more}", "").replace(told, "".join(descriptors))
        return read_phases(write(tmp_path, "take.eaf", text))

    assert read(media.format("take.mp4", "1500"))[0].start_s == pytest.approx(start + 1.5)
    both = [media.format("side.mp4", "700"), media.format("take.wav", "1500")]
    assert read(*both)[0].start_s == pytest.approx(start + 1.5)
    with pytest.raises(InputFileError, match=r"start at 0\.7 s, 1\.5 s \(TIME_ORIGIN\)"):
        read(media.format("side.mp4", "700"), media.format("front.mp4", "1500"))


# Choosing a tier ---------------------------------------------------------------------------------


def test_several_tiers_with_phases_are_listed(tmp_path):
    path = elan(tmp_path, SUBDIVIDED)
    with pytest.raises(InputFileError, match=r"several tiers.*'RH phase', 'parts'") as caught:
        read_phases(path)
    (name,) = typed(caught.value, "phase_tier")
    assert read_phases(path, name) == PHASES_OF_BOTH


def test_a_tier_that_is_not_there(tmp_path):
    with pytest.raises(InputFileError, match=r"no tier 'LH phase'.*'RH phase', 'words'"):
        read_phases(elan(tmp_path), "LH phase")


def test_no_tier_with_phases_alone(tmp_path):
    path = elan(tmp_path, STROKE="Wáve!")
    with pytest.raises(InputFileError, match=r"'RH phase' has 'Wáve!'; 'words' has 'wel") as caught:
        read_phases(path)
    (name,), (meanings,) = (typed(caught.value, key) for key in ("phase_tier", "phase_labels"))
    assert read_phases(path, name, meanings) == PHASES_OF_BOTH


def test_a_file_of_another_kind(tmp_path):
    with pytest.raises(InputFileError, match=r"\.anvil, \.eaf, \.csv"):
        read_phases(write(tmp_path, "take.pkl", ""))
    with pytest.raises(InputFileError, match="root element is 'annotation'"):
        read_phases(write(tmp_path, "take.eaf", ANVIL.format(encoding="utf-8")))
    with pytest.raises(InputFileError, match="No such file"):
        read_phases(tmp_path / "absent.eaf")


# Hostile files -----------------------------------------------------------------------------------

LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 30))


@pytest.mark.parametrize(
    "prologue",
    [
        f'<!DOCTYPE annotation [<!ENTITY l0 "ha">{LAUGHS}]>',
        '<!DOCTYPE annotation [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE annotation [<!ENTITY % x SYSTEM "http://localhost:1/x.dtd"> %x;]>',
        '<!DOCTYPE annotation [<!ENTITY x "quiet">]>',
    ],
    ids=["laughs", "file", "network", "plain"],
)
def test_entities_are_refused(tmp_path, prologue):
    text = f"{prologue}<annotation><body>&x;</body></annotation>"
    began = time.process_time()
    with pytest.raises(InputFileError, match="entity"):
        read_phases(write(tmp_path, "bad.anvil", text))
    assert time.process_time() - began < 5


def test_a_document_type_of_elsewhere_is_passed_over_and_its_entities_are_not_fetched(tmp_path):
    doctype = '<!DOCTYPE annotation SYSTEM "http://localhost:1/annotation.dtd">'
    text = ANVIL.format(encoding="utf-8").replace("<annotation>", doctype + "<annotation>")
    assert read_phases(write(tmp_path, "take.anvil", text)) == PHASES_OF_BOTH
    with pytest.raises(InputFileError, match="entity"):
        read_phases(write(tmp_path, "take.anvil", text.replace("prep", "&prep;")))


def test_depth_and_size_are_bounded(tmp_path, monkeypatch):
    deep = "<annotation>" + "<a>" * 100_000
    with pytest.raises(InputFileError, match="inside one another"):
        read_phases(write(tmp_path, "deep.anvil", deep))
    monkeypatch.setattr("cospeech.formats.phase_files.bounded_xml.MAX_ENTRIES", 5)
    with pytest.raises(InputFileError, match="line 8: more than 5 elements"):
        read_phases(write(tmp_path, "take.anvil", ANVIL.format(encoding="utf-8")))
    monkeypatch.setattr("cospeech.formats.phase_files.bounded_xml.MAX_BYTES", 99)
    with pytest.raises(InputFileError, match="too long"):
        read_phases(write(tmp_path, "take.anvil", ANVIL.format(encoding="utf-8")))


def test_many_tracks_that_refer_to_one_large_track_cost_no_more_than_their_size(tmp_path):
    els = "".join(f'<el index="{i}" start="{i}" end="{i + 1}"/>' for i in range(3000))
    spans = "".join(f'<track name="s{i}" type="span" ref="s{i - 1}"/>' for i in range(1, 3000))
    body = f'<track name="s0" type="primary">{els}</track>{spans}'
    text = f"<annotation><body>{body}</body></annotation>"
    began = time.process_time()
    with pytest.raises(InputFileError, match="no annotation"):
        read_phases(write(tmp_path, "wide.anvil", text))
    assert time.process_time() - began < 20


def test_not_well_formed(tmp_path):
    with pytest.raises(InputFileError, match=r"line 3: not well-formed XML: mismatched tag"):
        read_phases(write(tmp_path, "bad.eaf", "<ANNOTATION_DOCUMENT>\n<TIER>\n</TIE>"))
    with pytest.raises(InputFileError, match="XML"):
        read_phases(write(tmp_path, "bad.eaf", '<?xml version="1.0" encoding="klingon"?><a/>'))


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from([".anvil", ".eaf", ".csv"]),
    st.lists(
        st.tuples(st.integers(0, 5000), st.integers(0, 255), st.sampled_from("sid")), max_size=6
    ),
)
def test_damaged_files_raise_nothing_but_what_is_documented(tmp_path_factory, suffix, edits):
    whole = {
        ".anvil": ANVIL.format(encoding="utf-8"),
        ".eaf": ELAN.replace("{more}", REFERRING),
        ".csv": "start,end,label\n0.52,1.04,prep\n1.04,1.64,stroke\n",
    }[suffix]
    data = bytearray(whole.encode())
    for place, byte, how in edits:
        place %= len(data)
        if how == "s":
            data[place] = byte
        elif how == "i":
            data.insert(place, byte)
        else:
            del data[place : place + byte]
        data = data or bytearray(b"x")
    path = tmp_path_factory.getbasetemp() / f"damaged{suffix}"
    path.write_bytes(data)
    with contextlib.suppress(InputFileError):
        segments = read_phases(path)
        assert all(s.label in PHASES and s.start_s < s.end_s for s in segments)
