"""A cluster that speaks TLS only: who has the right certificate is let in, nobody else hangs."""

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from msgdrop_cli.cluster import connection, shared
from msgdrop_cli.cluster.control import shared_control
from msgdrop_cli.errors import RunError
from msgdrop_cli.records.store import list_runs
from msgdrop_cli.scheduler import run_tasks
from msgdrop_cli.stopping import graceful_stop
from tests.certificates import HAS_OPENSSL, Signed, authority, openssl, signed
from tests.dask_processes import Cluster, running
from tests.processes import tasks_for, tiny_runs
from tests.runs import digest

pytest.importorskip("distributed")
pytestmark = pytest.mark.skipif(not HAS_OPENSSL, reason="needs openssl")


class Secret(NamedTuple):
    """A cluster with TLS, one without, and certificates, good and bad ones."""

    tls: Cluster
    plain: Cluster
    good: Signed
    bad: dict[str, Signed]


@pytest.fixture(scope="module")
def secret(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secret]:
    """Two workers on loopback that only talk to who has a certificate by their authority."""
    folder = tmp_path_factory.mktemp("secret")
    ours, others = authority(folder, "ours"), authority(folder, "others")
    good = signed(folder, ours, "good")
    expired = signed(folder, ours, "expired", days=-1)
    foreign = signed(folder, others, "foreign")
    locked, word = folder / "locked.pem", folder / "word.txt"
    openssl("ec", "-in", good.key, "-aes256", "-passout", "pass:x", "-out", locked)
    word.write_text("no certificate")
    bad = {
        "expired": expired,
        "foreign": foreign._replace(authority=ours),
        "trusts others": good._replace(authority=others),
        "of others": foreign,
        "wrong key": good._replace(key=foreign.key),
        "locked key": good._replace(key=locked),
        "no certificate": good._replace(certificate=word),
        "no authority": good._replace(authority=word),
    }
    with (
        running(folder, workers=2, options=good.options, protocol="tls") as tls,
        running(folder, workers=0) as plain,
    ):
        yield Secret(tls, plain, good, bad)


@pytest.mark.slow
def test_tls_gives_the_same(secret: Secret, tmp_path: Path) -> None:
    """Two runs through an encrypted cluster, bit for bit those of this process."""
    results, here = tmp_path / "results", tmp_path / "here"
    results.mkdir()
    runs = tiny_runs()
    with graceful_stop() as control:
        run_tasks(tasks_for(runs, here), control, workers=1)
    with (
        connection.connected(secret.tls.address, secret.good) as client,
        graceful_stop(lambda: shared_control(results)) as control,
    ):
        client.wait_for_workers(2, timeout=40)
        assert client.scheduler.address.startswith("tls://")  # type: ignore[union-attr]
        outcomes = run_tasks(
            tasks_for(runs, results), control, workers=1, elsewhere=shared.on(client)
        )
    assert [each.status for each in outcomes] == ["done"] * 2
    assert {r.run_id: digest(r.path) for r in list_runs(results)} == {
        r.run_id: digest(r.path) for r in list_runs(here)
    }


@pytest.mark.parametrize(
    ("which", "words"),
    [
        ("expired", r"/expired\.pem: certificate has expired \(by .*/ours\.pem\)"),
        ("foreign", r"/foreign\.pem: .*issuer certificate \(by .*/ours\.pem\)"),
        ("trusts others", r"/good\.pem: .*issuer certificate \(by .*/others\.pem\)"),
        ("of others", r"its certificate is not to be trusted: "),
        ("wrong key", r"/foreign-key\.pem: is not the key of .*/good\.pem"),
        ("locked key", r"are no certificate and its key without a password"),
        ("no certificate", r"are no certificate and its key without a password"),
        ("no authority", r"/word\.txt: is no certificate of an authority"),
    ],
)
def test_a_wrong_certificate_is_one_line(secret: Secret, which: str, words: str) -> None:
    """Which file, and what is wrong with it; at once."""
    with (
        pytest.raises(RunError, match=words) as caught,
        connection.connected(secret.tls.address, secret.bad[which]),
    ):
        pass
    assert "\n" not in str(caught.value)


def test_no_certificate_is_one_line(secret: Secret) -> None:
    """An address of TLS and no files, and the other way round."""
    with (
        pytest.raises(RunError, match="tls:// needs --cluster-tls CA,CERT,KEY"),
        connection.connected(secret.tls.address),
    ):
        pass
    plain = secret.tls.address.replace("tls://", "dask://")
    with (
        pytest.raises(RunError, match=r"^dask://.*: no scheduler answers there: "),
        connection.connected(plain),
    ):
        pass


@pytest.mark.parametrize("scheme", ["tls", "dask"])
def test_nothing_is_said_without_encryption(secret: Secret, scheme: str) -> None:
    """A plain scheduler is no fallback, whatever the address is called."""
    where = secret.plain.address.replace("dask", scheme)
    with (
        pytest.raises(RunError, match=r"no encrypted connection"),
        connection.connected(where, secret.good),
    ):
        pass


@pytest.mark.parametrize("scheme", ["tls", "dask"])
def test_a_silent_port_is_no_wait(
    secret: Secret, scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody takes the call and says nothing."""
    monkeypatch.setattr(connection, "PATIENCE_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        where = f"{scheme}://127.0.0.1:{silent.getsockname()[1]}"
        files = secret.good if scheme == "tls" else ()
        with (
            pytest.raises(RunError, match=r"no scheduler answers there: "),
            connection.connected(where, files),
        ):
            pass


def test_workers_of_this_machine_take_no_certificate(secret: Secret) -> None:
    """Files that nobody reads would look like safety."""
    with (
        pytest.raises(RunError, match="local:1 takes no --cluster-tls"),
        connection.connected("local:1", secret.good),
    ):
        pass
