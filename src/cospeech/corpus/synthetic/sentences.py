"""What the simulated speakers say: a small grammar of everyday talk.

A talk is a chain of topics, a topic a few sentences about the same place and things. ``{slot}`` is
filled from the topic or from the common words, ``*`` marks an item of a list. Words that evoke
gestures are in `cospeech.corpus.synthetic.lexicon`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sentence:
    """A sentence to be spoken.

    Attributes:
        text: Words and punctuation, ready for `cospeech.speech.tts.speak_all`.
        listed: Indices of the words that are items of a list, in order.
        opens_topic: Whether the talk turns to something new here.
    """

    text: str
    listed: tuple[int, ...] = ()
    opens_topic: bool = False


_TOPICS: dict[str, dict[str, str]] = {
    "journey": {
        "place": "station harbour airport village bridge border valley hotel",
        "thing": "suitcase ticket map train passport window engine compass",
        "things": "tickets trains maps suitcases tunnels travellers",
        "person": "driver guide stranger captain traveller conductor",
        "event": "journey storm crossing holiday landing",
    },
    "kitchen": {
        "place": "kitchen market bakery garden table cellar",
        "thing": "oven recipe cake knife pumpkin kettle dinner basket",
        "things": "apples onions lemons plates potatoes candles carrots",
        "person": "cook baker neighbour waiter grandmother farmer",
        "event": "dinner party breakfast harvest wedding",
    },
    "house": {
        "place": "house attic cellar hallway balcony workshop roof",
        "thing": "ladder door chimney carpet mirror lamp cupboard piano",
        "things": "boxes windows chairs curtains hammers shelves",
        "person": "builder painter landlord carpenter visitor sister",
        "event": "move flood repair winter inspection",
    },
    "animals": {
        "place": "forest farm river meadow mountain island zoo",
        "thing": "horse eagle spider elephant turtle beaver squirrel tiger",
        "things": "rabbits spiders eagles beetles foxes sparrows",
        "person": "ranger doctor shepherd hunter keeper scientist",
        "event": "summer rain migration rescue hunt",
    },
    "work": {
        "place": "office laboratory factory library studio theatre",
        "thing": "project machine computer budget letter report model camera",
        "things": "meetings letters numbers drawings questions papers",
        "person": "manager teacher student engineer director colleague",
        "event": "meeting lecture deadline interview concert",
    },
    "music": {
        "place": "stage hall museum gallery cinema festival",
        "thing": "guitar painting drum melody trumpet picture story orchestra",
        "things": "songs dancers pictures drummers posters tickets",
        "person": "singer dancer painter composer actor critic",
        "event": "concert rehearsal opening show festival",
    },
}

_COMMON: dict[str, str] = {
    "big": "huge enormous giant massive gigantic vast wide big",
    "small": "tiny small little narrow thin miniature",
    "adjective": "wonderful strange beautiful difficult famous quiet terrible simple modern"
    " expensive ancient colourful dangerous brilliant ordinary",
    "said": "explained mentioned decided promised discovered believed remembered",
    "did": "repaired painted opened carried finished forgot borrowed changed followed",
    "moved": "walked travelled hurried wandered returned climbed",
    "adverb": "slowly suddenly carefully quickly finally usually",
    "time": "morning evening weekend season moment afternoon",
    "number": "two three four five six seven eight nine ten twelve twenty",
    "ordinal": "first second third",
    "direction": "left right",
    "vertical": "up down",
    "i": "I we",
    "reason": "weather traffic noise money darkness silence",
    "negative": "nobody nothing never",
    "doubt": "maybe perhaps probably somehow",
}

_OPENINGS: tuple[str, ...] = (
    "So, let me tell you about the {place}.",
    "Well, the {event} last {time} was really {adjective}.",
    "Now, the {person} is a completely different story.",
    "The next question is about the {thing} and the {place}.",
    "And then, of course, there was the {event}.",
)

_SENTENCES: tuple[tuple[float, str], ...] = (
    (1.6, "The {person} {said} that the {thing} was {adjective}."),
    (1.6, "After the {event}, the {person} {adverb} {did} the {thing}."),
    (1.4, "The {person} and the {person} {moved} to the {place} because of the {reason}."),
    (1.2, "It was a {adjective} {time}, and the {place} looked completely {adjective}."),
    (1.2, "People usually think that the {thing} belongs in the {place}, which is {adjective}."),
    (1.0, "What happened to the {thing} after the {event}?"),
    (1.0, "The {adjective} {thing} stood beside the {place} during the whole {event}."),
    (1.7, "There was a {big} {thing} in the middle of the {place}."),
    (1.3, "The {place} was {big}, really {big}, and full of {things}."),
    (1.6, "She showed the {person} a {small} {thing} from the {place}."),
    (1.2, "Only a {small} piece of the {thing} was {adjective}."),
    (1.8, "Turn {direction} at the {place}, and the {thing} stands {vertical} beside the {place}."),
    (1.5, "The {person} looked {vertical}, then {direction}, and {moved} straight ahead."),
    (1.2, "Go back to the {place}, and the {thing} is on the {direction} side."),
    (1.2, "The {things} went {vertical} and {vertical}, higher than the {place}."),
    (1.2, "They counted {number} {things} and {number} {things} near the {place}."),
    (0.8, "The {ordinal} {thing} was {adjective}, the {ordinal} one was not."),
    (1.0, "{i} told my {person} that the {thing} was {adjective}."),
    (0.9, "For me, the {adjective} part of the {event} was the {thing}."),
    (0.9, "You can find the {thing} over there, behind the {place}."),
    (0.9, "Everyone asked me about the {adjective} {thing}."),
    (0.8, "They gave you the {thing}, and you {adverb} {did} the {thing}."),
    (1.0, "{i} have never seen such a {adjective} {thing} in the {place}."),
    (0.9, "No, the {person} didn't know anything about the {event}."),
    (0.8, "There was nothing in the {place}, no {things}, no {things}, nobody."),
    (1.1, "The {person} {did} the {thing} again and again, around the {place}."),
    (1.1, "{doubt} the {person} {did} the {thing} before the {event}."),
    (0.7, "I wonder whether the {adjective} {person} {adverb} {did} it."),
    (1.3, "The {person} brought *{things}, *{things} and *{things} to the {event}."),
    (1.0, "We need a *{thing}, a *{thing}, a *{thing}, and *{things}."),
    (0.7, "The {place} was *{adjective}, *{adjective} and also *{adjective}."),
)
_WEIGHTS = np.array([weight for weight, _ in _SENTENCES])
_SLOT = re.compile(r"\{(\w+)\}")


def talk(rng: np.random.Generator, enough: float) -> list[Sentence]:
    """Sentences of one talk.

    Args:
        rng: Source of every choice.
        enough: Letters and spaces after which no further sentence is begun.
    """
    sentences: list[Sentence] = []
    letters = 0
    while letters < enough:
        topic = {**_COMMON, **_TOPICS[str(rng.choice(list(_TOPICS)))]}
        templates = [str(rng.choice(_OPENINGS))]
        chosen = rng.choice(
            len(_SENTENCES),
            size=int(rng.integers(3, 7)),
            replace=False,
            p=_WEIGHTS / _WEIGHTS.sum(),
        )
        templates += [_SENTENCES[i][1] for i in chosen]
        for position, template in enumerate(templates):
            sentence = _fill(template, topic, rng, opens_topic=position == 0)
            sentences.append(sentence)
            letters += len(sentence.text)
            if letters >= enough:
                break
    return sentences


def _fill(
    template: str, words: dict[str, str], rng: np.random.Generator, opens_topic: bool
) -> Sentence:
    """The template with its slots filled; no word fills two slots of a sentence."""
    used: set[str] = set()

    def choose(match: re.Match[str]) -> str:
        options = [word for word in words[match.group(1)].split() if word not in used]
        word = str(rng.choice(options or words[match.group(1)].split()))
        used.add(word)
        return word

    filled = _SLOT.sub(choose, template)
    filled = re.sub(r"\ba (\*?)(?=[aeiou])", r"an \1", filled)
    filled = filled[0].upper() + filled[1:]
    tokens = filled.split()
    listed = tuple(i for i, token in enumerate(tokens) if token.startswith("*"))
    return Sentence(filled.replace("*", ""), listed, opens_topic)


def vocabulary() -> set[str]:
    """Every word the grammar can say, in lower case."""
    texts = [*_OPENINGS, *(template for _, template in _SENTENCES)]
    words = {word for text in texts for word in re.findall(r"[\w']+", _SLOT.sub(" ", text))}
    for group in (_COMMON, *_TOPICS.values()):
        words.update(word for options in group.values() for word in options.split())
    return {word.lower() for word in words} | {"an"}
