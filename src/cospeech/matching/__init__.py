"""Motion matching: speech and the pose so far pick motion from a database of recordings.

Habibie et al. 2022, section 3.1 (docs/facts/motion_matching.md, sections 2 to 5).
"""
