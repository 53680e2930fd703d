"""A page of a paper's figures about how systems gesture."""

from cospeech.reporting.gesture_figures.page import GestureFigures, write_gesture_figures
from cospeech.reporting.gesture_figures.texts import text_table

__all__ = ["GestureFigures", "text_table", "write_gesture_figures"]
