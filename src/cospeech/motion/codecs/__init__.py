"""Codecs: how a method sees motion, with the way back to positions."""

from cospeech.motion.codecs.direction_vectors import DirectionVectorCodec, direction_vectors
from cospeech.motion.codecs.exponential_maps import ExponentialMapCodec
from cospeech.motion.codecs.parent_relative import ParentRelative, parents_of
from cospeech.motion.codecs.principal_components import PrincipalComponentCodec
from cospeech.motion.codecs.six_numbers import SixNumberCodec
from cospeech.motion.codecs.z_scores import Moments, ZScores

__all__ = [
    "DirectionVectorCodec",
    "ExponentialMapCodec",
    "Moments",
    "ParentRelative",
    "PrincipalComponentCodec",
    "SixNumberCodec",
    "ZScores",
    "direction_vectors",
    "parents_of",
]
