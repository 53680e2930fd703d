"""Lightning callbacks of the runs; ours take the `RunContext` as ``run``."""
