"""Values of the long-removed ``pyarrow.serialize``, which the published TED databases hold.

Pure Python and numpy: reads what pyarrow 0.13 to 11.0 wrote, never unpickles, and trusts no length
or offset in the value.
"""

from cospeech.formats.legacy_arrow.errors import LegacyArrowError
from cospeech.formats.legacy_arrow.framing import loads

__all__ = ["LegacyArrowError", "loads"]
