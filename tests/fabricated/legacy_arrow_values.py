"""Small values of every kind, several of them equal to the fixture's edge cases of that name."""

from datetime import datetime

import numpy as np

from tests.fabricated.legacy_arrow_writer import write_legacy_arrow

NUMBERS = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8"]
ARRAY = np.arange(24, dtype="f4").reshape(2, 3, 4)
AS_WRITTEN = {
    "none_first_then_mixed": [None, "x", 2.5, True, None, [1, None], (3,), {"k": None, None: 1}],
    "none_many_types_20": [None if i % 5 == 2 else i for i in range(20)],
    "none_only": None,
    "strings_unicode": [
        *("", "plain", "don't", "na\u00efve caf\u00e9", "\ud55c\uad6d\uc5b4", "\U0001f600"),
        "a\x00b",
    ],
    "bools_17": [i % 3 == 0 for i in range(17)],
    "bytes": [b"", b"\x00\xff", b"abc"],
    "empty_containers": [[], (), {}, set(), [[]], [()], [{}], {"a": []}, {"b": {}}],
    "dict_key_types": {"s": 1, 2: "two", 3.5: "f", (1, 2): "tup", b"b": 0, True: False},
    "list_of_dicts_different_keys": [{"a": 1}, {"b": 2.0, "c": "x"}, {}],
    "numpy_scalars": [
        *(np.float16(1.5), np.float32(0.1), np.float64(0.1), np.int8(-3), np.uint8(200)),
        *(np.int32(5), np.int64(-6), np.uint64(2**62), np.bool_(True), np.str_("npstr")),
    ],
    "arrays_all_dtypes": [np.arange(6).reshape(2, 3).astype(d) for d in NUMBERS],
    "array_0d_and_empty": [
        *(np.array(3.5), np.zeros((0,), "f4"), np.zeros((0, 10, 3), "f2"), np.zeros((4, 0), "i4")),
    ],
    "array_orders": [
        *(ARRAY, np.asfortranarray(ARRAY), ARRAY.transpose(2, 0, 1), ARRAY[:, ::2]),
        *(ARRAY[:, :, 1], ARRAY[0:1], np.broadcast_to(np.float32(2), (3, 2))),
    ],
    "datetime_date64": datetime(2019, 7, 16, 12, 34, 56, 789012),
}


def marked(name, data, **more):
    """A value of a type that pyarrow's Python side turned into a dict."""
    return write_legacy_arrow({"data": data, "_pytype_": name, **more})
