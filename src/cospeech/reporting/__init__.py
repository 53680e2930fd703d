"""Seeing and hearing results: player pages, video, tables and reports, read from records."""
