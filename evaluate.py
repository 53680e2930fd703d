"""Judge a finished run, or study the metrics: ``python evaluate.py run=DIR | study=NAME``."""

# Processes that read a corpus import this file too, and need nothing of what is below.
if __name__ == "__main__":
    import hydra
    from omegaconf import DictConfig

    from cospeech.experiment import command_line, evaluate

    @hydra.main(version_base="1.3", config_path="conf", config_name="evaluate")
    def main(cfg: DictConfig) -> None:
        """Hydra's entry point."""
        command_line(evaluate, cfg)

    main()
