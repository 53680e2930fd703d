"""Processes that write for ever and are killed while they do."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

SERVER = """
import os
import sys


def say(line):  # in one piece, as two processes say something
    os.write(1, f"{line}\\n".encode())


for line in sys.stdin:  # a child per line: the imports are paid once
    child = os.fork()
    if child == 0:
        number = int(line)
        while True:
            number += 1
            write(number)
            say(number)
    say(f"child {child}")
    os.waitpid(child, 0)
    say("ended")
"""


def killed_writing(
    script: str, *arguments: str, times: int, **environment: str
) -> Iterator[tuple[int, int]]:
    """Kill a process many times while it writes one number after the other.

    Args:
        script: Defines ``write(number)``; its arguments are in ``sys.argv``.
        arguments: The script's.
        times: How often it is killed, at random moments.
        environment: Added to this process's.

    Yields:
        After each kill, the number it had begun with and the last one that it had written.
    """
    seed = random.SystemRandom().randrange(2**32)
    print("seed", seed)  # shown where a test fails
    draw = random.Random(seed)
    process = subprocess.Popen(
        [sys.executable, "-c", script + SERVER, *arguments],
        cwd=Path(__file__).resolve().parents[1],
        env={**os.environ, "OMP_NUM_THREADS": "1", **environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    known = 0
    try:
        for _ in range(times):
            process.stdin.write(f"{known}\n")
            process.stdin.flush()
            started, child = known, None
            wanted = known + draw.randrange(1, 4)
            while child is None or known < wanted:
                child, known = _heard(process.stdout.readline(), child, known)
            time.sleep(draw.random() * 0.02)
            os.kill(child, signal.SIGKILL)
            while (line := process.stdout.readline()) != "ended\n":
                child, known = _heard(line, child, known)
            yield started, known
    finally:
        process.stdin.close()
        process.wait(timeout=300)


def _heard(line: str, child: int | None, known: int) -> tuple[int | None, int]:
    assert line, "the process has ended"
    if line.startswith("child"):
        return int(line.split()[1]), known
    return child, int(line)
