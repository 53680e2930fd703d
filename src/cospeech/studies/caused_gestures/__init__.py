"""Do words bring their gestures, and come beats in time, where each stroke's cause is known?"""

from cospeech.studies.caused_gestures.study import caused_gestures

__all__ = ["caused_gestures"]
