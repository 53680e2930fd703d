"""Lightning data modules: one per corpus, thin, over a prepared store."""
