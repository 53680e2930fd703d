"""What an inline chart draws, by the titles that a pointer finds."""

import re
from xml.etree import ElementTree


def drawn(svg):
    """(title, paths) of all that has a title; a path is its corners, or where a marker is."""
    found = []
    for group in ElementTree.fromstring(svg).iter("g"):
        paths = [
            [tuple(map(float, pair)) for pair in re.findall(r"([-.\d]+) ([-.\d]+)", path.get("d"))]
            for path in group.findall("path")
        ]
        paths += [[(float(use.get("x")), float(use.get("y")))] for use in group.findall("use")]
        found.append((group.find("title").text, paths))
    return found


def texts(svg):
    """Everything written, in order."""
    return [element.text for element in ElementTree.fromstring(svg).iter("text")]
