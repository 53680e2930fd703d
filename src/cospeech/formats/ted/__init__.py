"""The TED set's clips, its published preprocessing, and the way to recordings.

Up to `recordings`, everything is in the set's own units and axes: positions with a mean bone of
0.2, x to the speaker's right, y down, z forward, and seconds on the video's clock.
"""
