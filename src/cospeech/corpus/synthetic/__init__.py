"""The embedded corpus: a simulated world of talking people whose gestures have known causes."""

from cospeech.corpus.synthetic.corpus import GENERATOR_VERSION, build_take, synthesise
from cospeech.corpus.synthetic.skeleton import SKELETON
from cospeech.corpus.synthetic.takes import TakePlan, plan

__all__ = ["GENERATOR_VERSION", "SKELETON", "TakePlan", "build_take", "plan", "synthesise"]
