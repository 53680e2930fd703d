"""Files as they come out of a bad disk."""


def flipped(data: bytes) -> bytes:
    """With one bit changed, in the middle."""
    changed = bytearray(data)
    changed[len(data) // 2] ^= 0x40
    return bytes(changed)
