"""How a system gestures, in numbers: the evaluation of Ferstl et al. 2020, section 8.

Pure functions of joint positions are in `wrists` (velocity, range, scatter), `movement` (bones,
repetition, jitter, holds, seams) and `phase_structure`; `measuring` takes them of several systems
on the same speech, with intervals, and `findings` holds what the paper saw against them.

Positions are ``(..., J, 3)`` in metres at 20 fps, relative to the pelvis and facing +z
(`cospeech.motion.gesture_joints`).
"""
