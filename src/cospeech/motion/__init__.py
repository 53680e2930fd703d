"""Skeletons, motion, and the conversions between ways of writing a pose."""
