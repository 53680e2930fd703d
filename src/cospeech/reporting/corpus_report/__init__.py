"""One self-contained HTML page about a prepared corpus, to judge whether its data is sane."""

from cospeech.reporting.corpus_report.page import write_corpus_report

__all__ = ["write_corpus_report"]
