"""Acoustic features as single papers define them; the general ones are in `features`, `pitch`.

NumPy in and out, on 16 kHz waveforms, with one code path for preparing data and for synthesis.
"""
