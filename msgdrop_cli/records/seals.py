"""How checkpoints and archives know that a file is what was written: size, digest, and a seal."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

Fingerprint = dict[str, int | str]


def fingerprint(content: bytes) -> Fingerprint:
    """Size in bytes and SHA-256."""
    return {"size": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def seal(manifest: Mapping[str, Any]) -> str:
    """SHA-256 over a manifest: a digit changed in a counter is damage, too."""
    return hashlib.sha256(json.dumps(manifest, sort_keys=True).encode()).hexdigest()
