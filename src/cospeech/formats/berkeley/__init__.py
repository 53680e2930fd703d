"""The Berkeley speech2gesture set: 2-D keypoints as downloaded, and the 3-D extension by speaker.

`keypoints2d.find_2d_sources` and `extension3d.find_3d_sources` list what is on disk.
"""

SPEAKERS = (
    "oliver",
    "jon",
    "conan",
    "rock",
    "chemistry",
    "ellen",
    "almaram",
    "angelica",
    "seth",
    "shelly",
)
"""The ten published speakers."""

SPLITS = {"train": "train", "dev": "val", "test": "test"}
"""Published split name -> ours."""

LICENCE = "research only, on request from the authors; see the set's page"
