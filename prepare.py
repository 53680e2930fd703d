"""Convert a corpus once into its store: ``python prepare.py data=mocap data.root=DIR``."""

# Processes that read a corpus import this file too, and need nothing of what is below.
if __name__ == "__main__":
    import hydra
    from omegaconf import DictConfig

    from cospeech.experiment import command_line, prepare

    @hydra.main(version_base="1.3", config_path="conf", config_name="prepare")
    def main(cfg: DictConfig) -> None:
        """Hydra's entry point."""
        command_line(prepare, cfg)

    main()
