"""A page in a headless Chromium, driven over a pipe by its own protocol; nothing is installed."""

import base64
import json
import os
import select
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
_FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--remote-debugging-pipe"),
    *("--disable-background-networking", "--disable-extensions", "--disable-dev-shm-usage"),
)
_PATIENCE_S = 30.0


class Browser:
    """One tab. It answers what it is asked, and keeps what happened in between."""

    def __init__(self, asks: int, answers: int) -> None:
        self.asks, self.answers, self.heard = asks, answers, b""
        self.number = 0
        self.events: list[dict[str, Any]] = []
        self.session: str | None = None
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        found = self.ask("Target.attachToTarget", targetId=target, flatten=True)
        self.session = found["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **params: Any) -> Any:
        """The result of a command of the DevTools protocol."""
        self.number += 1
        told: dict[str, Any] = {"id": self.number, "method": method, "params": params}
        if self.session:
            told["sessionId"] = self.session
        os.write(self.asks, json.dumps(told).encode() + b"\0")
        while (answer := self._next()).get("id") != self.number:
            self.events.append(answer)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def open(self, path: Path, *, width: int = 1280, height: int = 900, dark: bool = False) -> None:
        """Show a file, and wait until all of it is there."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
        self.ask("Emulation.setDeviceMetricsOverride", **size)
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.ask("Emulation.setEmulatedMedia", features=scheme)
        self.events.clear()
        self.ask("Page.navigate", url=path.resolve().as_uri())
        while not any(event["method"] == "Page.loadEventFired" for event in self.events):
            self.events.append(self._next())

    def says(self, script: str) -> Any:
        """The value of an expression in the page."""
        result = self.ask("Runtime.evaluate", expression=script, returnByValue=True,
                          awaitPromise=True)  # fmt: skip
        if "exceptionDetails" in result:
            raise RuntimeError(f"{script}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def complaints(self) -> list[dict[str, Any]]:
        """Errors, warnings and refusals since the page was opened."""
        kinds = ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded")
        return [event for event in self.events if event["method"] in kinds]

    def requests(self) -> list[str]:
        """Addresses that were asked for, without what stands in the file itself."""
        sent = [e["params"]["request"]["url"] for e in self.events
                if e["method"] == "Network.requestWillBeSent"]  # fmt: skip
        return [url for url in sent if not url.startswith("data:")]

    def screenshot(self, to: Path, *, whole: bool = False) -> None:
        """Write what is seen, or the whole page, as PNG."""
        shot = self.ask("Page.captureScreenshot", captureBeyondViewport=whole)
        to.write_bytes(base64.b64decode(shot["data"]))

    def pdf(self, to: Path) -> None:
        """Print it on A4."""
        printed = self.ask("Page.printToPDF", printBackground=True, paperWidth=8.27,
                           paperHeight=11.69)  # fmt: skip
        to.write_bytes(base64.b64decode(printed["data"]))

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self.heard:
            if not select.select([self.answers], [], [], _PATIENCE_S)[0]:
                raise RuntimeError(f"the browser says nothing for {_PATIENCE_S:g} s")
            if not (more := os.read(self.answers, 1 << 20)):
                raise RuntimeError("the browser has gone")
            self.heard += more
        message, _, self.heard = self.heard.partition(b"\0")
        answer: dict[str, Any] = json.loads(message)
        return answer


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser of its own, gone afterwards."""
    asks_read, asks_write = os.pipe()
    answers_read, answers_write = os.pipe()
    # Its helpers write there for a moment longer than it lives.
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        # It reads commands from descriptor 3 and answers on 4, whatever the pipes' numbers are.
        line = f'exec "$0" "$@" 3<&{asks_read} 4>&{answers_write}'
        process = subprocess.Popen(
            ["bash", "-c", line, str(CHROMIUM), *_FLAGS, f"--user-data-dir={profile}"],
            pass_fds=(asks_read, answers_write),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(asks_read)
        os.close(answers_write)
        try:
            yield Browser(asks_write, answers_read)
        finally:
            os.close(asks_write)
            os.close(answers_read)
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
