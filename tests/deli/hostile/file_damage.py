"""Ways to damage a file, and a process that uses damaged files as users do."""

import json
import subprocess
import sys
from pathlib import Path

KINDS = ("bit", "bits", "zeros", "ones", "noise", "swap", "cut", "longer", "structure")
STRUCTURE = 6000
"""Bytes at the beginning of a file in which there are few numbers and much structure."""


def damaged(content, rng):
    """Return a file's bytes with one damage of a random kind, and what was done."""
    kind, data, size = rng.choice(KINDS), bytearray(content), len(content)
    begin, length = rng.randrange(size), int(2 ** rng.uniform(0, 12))
    if kind in ("bit", "bits"):
        for _ in range(1 if kind == "bit" else rng.randrange(2, 50)):
            data[rng.randrange(size)] ^= 1 << rng.randrange(8)
    elif kind == "structure":
        data[rng.randrange(min(size, STRUCTURE))] = rng.randrange(256)
    elif kind == "swap":
        other = rng.randrange(size)
        length = min(length, size - begin, size - other)
        data[begin : begin + length], data[other : other + length] = (
            data[other : other + length],
            data[begin : begin + length],
        )
    elif kind == "cut":
        del data[begin:]
    elif kind == "longer":
        data += rng.randbytes(length)
    else:
        length = min(length, size - begin)
        filler = {"zeros": bytes(length), "ones": b"\xff" * length, "noise": rng.randbytes(length)}[kind]
        data[begin : begin + length] = filler
    return bytes(data), f"{kind} at {begin}, {length}"


def use(orders, folder):
    """Do with files what the orders say, all in one process; see `file_victim.py` for what they and answers are.

    Fails where that process dies, naming the file.
    """
    script = Path(__file__).with_name("file_victim.py")
    found = subprocess.run(
        [sys.executable, str(script)],
        input="\n".join(json.dumps(order) for order in orders),
        capture_output=True,
        text=True,
        cwd=folder,
    )
    answers = [json.loads(line) for line in found.stdout.splitlines()]
    assert len(answers) == len(orders), f"died of {orders[len(answers)]}, {found.returncode}: {found.stderr[-2000:]}"
    assert found.returncode == 0, found.stderr
    return answers
