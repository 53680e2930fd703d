"""Recordings, the prepared store, windows and splits."""
