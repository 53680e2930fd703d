"""The notation in which the genuine TED-like values' sidecars describe what they hold."""

import base64
import hashlib
from collections import Counter, deque
from datetime import datetime

import numpy as np


def describe(value, inline=64):
    """A value in the fixture's notation (its README)."""
    match value:
        case None:
            return {"t": "none"}
        case np.ndarray() if value.dtype == object:
            items = [describe(item) for item in value.ravel().tolist()]
            return {"t": "ndarray", "dtype": "|O", "shape": list(value.shape), "items": items}
        case np.ndarray():
            raw = np.ascontiguousarray(value).tobytes()
            about = {"t": "ndarray", "dtype": value.dtype.str, "shape": list(value.shape)}
            about["sha256"] = hashlib.sha256(raw).hexdigest()
            if value.size <= inline:
                about["b64"] = base64.b64encode(raw).decode()
            return about
        case np.float16():
            return {"t": "float16", "bits": int(value.view("u2"))}
        case bool() | str():
            return {"t": type(value).__name__, "v": value}
        case int():
            return {"t": "int", "v": str(value)}
        case float():
            return {"t": "float", "v": value.hex() if value == value else "nan"}
        case bytes():
            return {"t": "bytes", "v": base64.b64encode(value).decode()}
        case datetime():
            return {"t": "datetime", "v": value.isoformat()}
        case dict():
            items = sorted(value.items()) if isinstance(value, Counter) else value.items()
            pairs = [[describe(key, inline), describe(item, inline)] for key, item in items]
            return {"t": type(value).__name__, "v": pairs}
        case set():
            return {"t": "set", "v": sorted((describe(item) for item in value), key=repr)}
        case list() | tuple() | deque():
            return {"t": type(value).__name__, "v": [describe(item, inline) for item in value]}
    raise TypeError(type(value))


def expected(node):
    """A sidecar's description as `loads` gives it: buffers are bytes, tensors arrays."""
    if isinstance(node, dict):
        renamed = {"buffer": "bytes", "tensor": "ndarray"}
        return {
            key: renamed.get(item, item) if key == "t" else expected(item)
            for key, item in node.items()
        }
    return [expected(item) for item in node] if isinstance(node, list) else node
