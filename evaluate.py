"""Judge a finished run, or study the metrics: ``python evaluate.py run=DIR | study=NAME``."""

# Processes that read a corpus import this file too, and need nothing of what is below.
if __name__ == "__main__":
    from cospeech.terminal import stop_at_once

    stop_at_once()

    from omegaconf import DictConfig

    from cospeech.experiment.command_line import command

    def task(cfg: DictConfig) -> None:
        """The task, imported when the settings are known to be good."""
        from cospeech.experiment import evaluate

        evaluate(cfg)

    command(task, __file__)
