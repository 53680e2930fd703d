"""Train a method: ``python train.py model=trimodal`` (``--help`` lists every group)."""

# Processes that read a corpus import this file too, and need nothing of what is below.
if __name__ == "__main__":
    from cospeech.terminal import stop_at_once

    stop_at_once()

    from omegaconf import DictConfig

    from cospeech.experiment.command_line import command

    def train(cfg: DictConfig) -> float | None:
        """Run, and give a sweep the value it minimises."""
        from cospeech.experiment import run

        return run(cfg).objective

    command(train, __file__)
