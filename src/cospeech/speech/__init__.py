"""Speech: audio, acoustic features, transcripts, vocabulary, synthesis."""
