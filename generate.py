"""Gestures for a recording: ``python generate.py run=outputs/runs/ID audio=speech.wav``."""

if __name__ == "__main__":
    import hydra
    from omegaconf import DictConfig

    from cospeech.experiment import command_line, generate

    @hydra.main(version_base="1.3", config_path="conf", config_name="generate")
    def main(cfg: DictConfig) -> None:
        """Hydra's entry point."""
        command_line(generate, cfg)

    main()
