"""Fuzz the readers: `python -m tests.fuzz [READER ...] [--seconds N]`.

With atheris (the extra `fuzz`) it sees which branches a file takes; without it, bytes are changed
blindly. A finding is written into `tests/corpus/readers/<reader>/`, from where the test suite reads
it ever after.
"""

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from random import Random

FOUND = Path(__file__).parents[1] / "corpus" / "readers"
_SECONDS = 60
_SLOW_S, _MEGABYTES = 5, 2_048
_JUNK = (b"9" * 30, b"{", b"[" * 40, b'"', b"-", b"\x00", b"\n", b"\x1b[2J", b"../", b"1e999")


def main() -> int:
    """Fuzz each reader in a process of its own; returns how many had a finding."""
    asked = _asked()
    if asked.inside:
        [name] = asked.readers
        _fuzz(name, asked.seconds)
        return 0
    from tests.fuzz.readers import READERS

    failed = 0
    for name in asked.readers or READERS:
        inside = [sys.executable, "-m", "tests.fuzz", name, "--seconds", str(asked.seconds)]
        done = subprocess.run([*inside, "--inside"], capture_output=True, text=True)
        failed += done.returncode != 0
        print(f"{name:<16}{_told(done)}", flush=True)
        if done.returncode:
            print(done.stdout[-3_000:], done.stderr[-3_000:])
    return failed


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("readers", nargs="*", help="which; all without a word")
    parser.add_argument("--seconds", type=int, default=_SECONDS, help="for each reader")
    parser.add_argument("--inside", action="store_true", help="in this process")
    return parser.parse_args()


def _told(done: subprocess.CompletedProcess[str]) -> str:
    """The last line about how much was tried."""
    lines = [line for line in (done.stdout + done.stderr).splitlines() if "tried" in line.lower()]
    lines += [line for line in done.stderr.splitlines() if line.startswith("Done ")]
    return lines[-1] if lines else f"ended with {done.returncode}"


def _fuzz(name: str, seconds: int) -> None:
    try:
        import atheris
    except ImportError:
        _change_bytes(name, seconds)
        return
    with atheris.instrument_imports(include=["msgdrop_cli", "zipfile", "json", "tomllib"]):
        from tests.fuzz.readers import READERS, try_reading
    folder = FOUND / name
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as seeds:
        for number, seed in enumerate(READERS[name].seeds()):
            (Path(seeds) / f"sound-{number}").write_bytes(seed)
        options = [f"-max_total_time={seconds}", f"-timeout={_SLOW_S}", "-print_final_stats=1"]
        options += [f"-rss_limit_mb={_MEGABYTES}", f"-artifact_prefix={folder}/", "-max_len=65536"]
        atheris.Setup(
            [sys.argv[0], *options, seeds, str(folder)], lambda data: try_reading(name, data)
        )
        atheris.Fuzz()


def _change_bytes(name: str, seconds: float) -> None:
    """Change some bytes of sound files and of earlier findings, until the time is over."""
    from tests.fuzz.readers import READERS, try_reading

    sound = [*READERS[name].seeds(), *(each.read_bytes() for each in (FOUND / name).glob("*"))]
    rng, end, tried = Random(os.urandom(8)), time.monotonic() + seconds, 0
    while time.monotonic() < end:
        content = bytearray(rng.choice(sound))
        for _ in range(rng.choice((1, 2, 5, 30))):
            place = rng.randrange(len(content) + 1)
            match rng.randrange(4):
                case 0 if place < len(content):
                    content[place] = rng.randrange(256)
                case 1:
                    del content[place : place + rng.choice((1, 3, 40))]
                case 2:
                    content[place:place] = rng.choice(_JUNK)
                case _:
                    other = rng.choice(sound)
                    start = rng.randrange(len(other) + 1)
                    content[place:place] = other[start : start + rng.choice((1, 8, 100))]
        tried += 1
        try:
            try_reading(name, bytes(content))
        except BaseException:
            (FOUND / name).mkdir(parents=True, exist_ok=True)
            digest = hashlib.sha256(content).hexdigest()[:12]
            (FOUND / name / f"crash-{digest}").write_bytes(content)
            raise
    print(f"tried {tried:,} files")


if __name__ == "__main__":
    sys.exit(main())
