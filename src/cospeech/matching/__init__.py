"""Motion matching: speech and the pose so far pick motion from a database of recordings.

Habibie et al. 2022, section 3.1 (spec A.2 to A.5).
"""
