"""An authority and certificates by it, of nobody, for tests."""

import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

_CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
HAS_OPENSSL = shutil.which("openssl") is not None


class Signed(NamedTuple):
    """The three files of `--cluster-tls`."""

    authority: Path
    certificate: Path
    key: Path

    @property
    def options(self) -> tuple[str | Path, ...]:
        """As `dask scheduler` and `dask worker` take them."""
        names = ("--tls-ca-file", "--tls-cert", "--tls-key")
        return tuple(word for pair in zip(names, self, strict=True) for word in pair)

    @property
    def option(self) -> str:
        """As `msgdrop` takes them."""
        return ",".join(map(str, self))


def authority(folder: Path, name: str) -> Path:
    """A certificate that signs others, for two days, and says so, as Python 3.13 asks."""
    key, file = folder / f"{name}-key.pem", folder / f"{name}.pem"
    about = ("-days", 2, "-subj", f"/CN={name}", "-addext", "keyUsage=critical,keyCertSign")
    openssl("req", "-x509", *_CURVE, "-keyout", key, "-out", file, *about)
    return file


def signed(folder: Path, by: Path, name: str, days: int = 2) -> Signed:
    """A certificate by this authority, and its key; of less than no days, it has expired."""
    key, asked, file = (folder / f"{name}{end}" for end in ("-key.pem", ".csr", ".pem"))
    openssl("req", *_CURVE, "-keyout", key, "-out", asked, "-subj", f"/CN={name}")
    signer = by.with_name(f"{by.stem}-key.pem")
    by_whom = ("-CA", by, "-CAkey", signer, "-CAcreateserial")
    told = folder / "extensions.txt"
    told.write_text("subjectKeyIdentifier=hash\nauthorityKeyIdentifier=keyid\n")
    openssl("x509", "-req", "-in", asked, *by_whom, "-out", file, "-days", days, "-extfile", told)
    return Signed(by, file, key)


def openssl(*words: str | int | Path) -> None:
    """Run it; it must do what it is told."""
    subprocess.run(["openssl", *map(str, words)], check=True, capture_output=True)
