"""The generator's weights at moments of its pre-training (Ferstl et al. 2020, section 6.1)."""

from __future__ import annotations

import copy

from torch import Tensor, nn

from cospeech.methods.multi_adversary.networks import Generator

State = dict[str, Tensor]


class WeightHistory:
    """Snapshots that the phase adversary is led through; a checkpoint holds `states`.

    Args:
        moments: Finished steps at which to keep the weights, ascending, from 0.
    """

    def __init__(self, moments: tuple[int, ...]) -> None:
        self.moments = moments
        self._states: list[State] = []
        self._loaded: tuple[int, Generator] | None = None

    @property
    def states(self) -> list[State]:
        """The snapshots so far."""
        return self._states

    @states.setter
    def states(self, states: list[State]) -> None:
        self._states, self._loaded = states, None

    def note(self, step: int, generator: Generator) -> None:
        """Keep the weights if ``step`` finished steps are one of the moments."""
        if step in self.moments:
            self._states.append(on_cpu(generator))

    def generator(self, level: int, like: Generator) -> Generator:
        """The generator of a level; another object than ``like``, whose shape it has."""
        if self._loaded is None or self._loaded[0] != level:
            generator = copy.deepcopy(like)
            generator.load_state_dict(self._states[level])
            self._loaded = (level, generator)
        return self._loaded[1]


def on_cpu(module: nn.Module) -> State:
    """A copy of a module's state, for files and checkpoints."""
    return {name: value.detach().cpu().clone() for name, value in module.state_dict().items()}
