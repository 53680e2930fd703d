"""Train a method: ``python train.py model=trimodal`` (``--help`` lists every group)."""

# Processes that read a corpus import this file too, and need nothing of what is below.
if __name__ == "__main__":
    import hydra
    from omegaconf import DictConfig

    from cospeech.experiment import command_line, run

    def train(cfg: DictConfig) -> float | None:
        """Run, and give a sweep the value it minimises."""
        return run(cfg).objective

    @hydra.main(version_base="1.3", config_path="conf", config_name="train")
    def main(cfg: DictConfig) -> float | None:
        """Hydra's entry point."""
        return command_line(train, cfg)

    main()
