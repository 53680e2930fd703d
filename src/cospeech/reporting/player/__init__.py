"""A self-contained page that plays skeletons in sync with the speech."""

from cospeech.reporting.player.page import PlayerClip, write_player

__all__ = ["PlayerClip", "write_player"]
