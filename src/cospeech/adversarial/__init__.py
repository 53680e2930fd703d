"""Adversaries: discriminators with their losses, weight and start."""
