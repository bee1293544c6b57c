"""The user's own certificate: what is wrong with it, in words that TLS itself does not say.

The side that was refused hears next to nothing (an expired certificate is an "EOF"), and a key with
a password would make OpenSSL ask for it in the middle of our output.
"""

import ssl
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RunError


class Identity(NamedTuple):
    """Who we are and whom we trust, as the files of `--cluster-tls CA,CERT,KEY` say."""

    files: Sequence[Path]
    trust: ssl.SSLContext
    ours: ssl.SSLContext


def read(files: Sequence[Path]) -> Identity:
    """The three files; RunError unless they are an authority, a certificate, and its open key."""
    authority, certificate, key = files
    try:
        trust = ssl.create_default_context(cafile=str(authority))
    except OSError as error:
        raise _wrong(
            f"{authority}: is no certificate of an authority (CA, the first of three)"
        ) from error
    trust.check_hostname = False  # Dask's certificates need name no hosts
    ours = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        ours.load_cert_chain(certificate, key, password=lambda: b"")
    except OSError as error:
        if "KEY_VALUES_MISMATCH" in str(error):
            raise _wrong(f"{key}: is not the key of {certificate}") from error
        problem = f"{certificate} and {key}: are no certificate and its key without a password"
        raise _wrong(problem) from error
    return Identity(files, trust, ours)


def why_refused(identity: Identity) -> str:
    """What anybody who trusts our authority has against our certificate; empty if nothing.

    Found by shaking hands with ourselves: signature and dates are checked as a peer does it.
    """
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    sides = (
        identity.trust.wrap_bio(back, there),
        identity.ours.wrap_bio(there, back, server_side=True),
    )
    try:
        for _ in range(4):  # more than any version of TLS needs
            for side in sides:
                try:
                    side.do_handshake()
                except ssl.SSLWantReadError:
                    continue
    except ssl.SSLCertVerificationError as error:
        authority, certificate, _ = identity.files
        return one_line(f"{certificate}: {error.verify_message} (by {authority})")
    except ssl.SSLError as error:
        return one_line(f"{identity.files[1]}: {error.reason}")
    return ""


def _wrong(problem: str) -> RunError:
    return RunError(one_line(f"--cluster-tls: {problem}"))
