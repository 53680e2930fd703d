"""Gestures for a recording: ``python generate.py run=outputs/runs/ID audio=speech.wav``."""

if __name__ == "__main__":
    from cospeech.terminal import stop_at_once

    stop_at_once()

    from omegaconf import DictConfig

    from cospeech.experiment.command_line import command

    def task(cfg: DictConfig) -> None:
        """The task, imported when the settings are known to be good."""
        from cospeech.experiment import generate

        generate(cfg)

    command(task, __file__)
