"""Text as vectors: one for each word, from a table of words or from a language model."""
