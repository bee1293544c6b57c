"""Who is at work, by the kernel's own list of locks: none is taken to find out."""

import os
from pathlib import Path

Held = set[tuple[int, int, int]]
"""Device (major, minor) and inode of files."""


def locked_files() -> Held:
    """Every file of this machine that somebody holds; none where the kernel has no such list."""
    held = set()
    try:
        lines = Path("/proc/locks").read_text().splitlines()
    except OSError:
        return set()
    for line in lines:
        major, minor, inode = next(word for word in line.split() if word.count(":") == 2).split(":")
        held.add((int(major, 16), int(minor, 16), int(inode)))
    return held


def is_held(lock: Path, held: Held) -> bool:
    """Whether this file is among them; one that is not there is not."""
    try:
        facts = lock.stat()
    except OSError:
        return False
    return (os.major(facts.st_dev), os.minor(facts.st_dev), facts.st_ino) in held
