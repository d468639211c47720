"""A headless Chromium, spoken to over its debugging pipe: pages opened at a width, by day or by night."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path
from types import TracebackType
from typing import Any

PROGRAM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
_PATIENCE_S = 120.0


class Chromium:
    """One browser with one tab."""

    def __init__(self, profile: Path) -> None:
        assert PROGRAM is not None
        to_browser, self._to = os.pipe()
        self._from, from_browser = os.pipe()
        # The protocol is spoken over descriptors 3 and 4, both sides ending a message with a zero byte.
        options = f"--headless=new --no-sandbox --disable-gpu --disable-dev-shm-usage --user-data-dir={profile}"
        command = f'exec "$0" {options} --remote-debugging-pipe about:blank 3<&{to_browser} 4>&{from_browser}'
        self._process = subprocess.Popen(
            ["bash", "-c", command, PROGRAM],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._number, self._rest, self._session = 0, b"", ""
        self.complaints: list[str] = []
        self.requests: list[str] = []
        target = self._ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._ask(f"{domain}.enable")

    def __enter__(self) -> Chromium:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self._process.wait(_PATIENCE_S)
        os.close(self._to)
        os.close(self._from)

    def open(self, page: Path, width: int, scheme: str) -> None:
        """Open a page and wait until its figure stands, where it has one."""
        self.complaints, self.requests = [], []
        self.dress(width, scheme)
        self._ask("Page.navigate", url=page.resolve().as_uri())
        ready = (
            "document.readyState === 'complete' && (!document.getElementById('linked-figure') || "
            "document.documentElement.dataset.figure === 'ready') && !!document.querySelector('main')"
        )
        end = time.monotonic() + _PATIENCE_S
        while not self.run(ready):
            assert time.monotonic() < end, f"not drawn; {self.complaints}"
            time.sleep(0.05)
        self._let_draw()

    def dress(self, width: int, scheme: str, media: str = "screen") -> None:
        """Make the window as wide, the system light or dark, the medium screen or print, whatever page is open."""
        self._ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 500
        )
        wanted = [{"name": "prefers-color-scheme", "value": scheme}]
        self._ask("Emulation.setEmulatedMedia", media=media, features=wanted)
        self._let_draw()

    def run(self, script: str) -> Any:
        """Return what a script gives, promises awaited."""
        answer = self._ask("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def drag(self, start: tuple[float, float], stop: tuple[float, float]) -> None:
        """Drag the mouse from one point of the window to another."""
        self._mouse("mouseMoved", start, 0)
        self._mouse("mousePressed", start, 1)
        for share in (0.3, 0.7, 1.0):
            at = (start[0] + share * (stop[0] - start[0]), start[1] + share * (stop[1] - start[1]))
            self._mouse("mouseMoved", at, 1)
        self._mouse("mouseReleased", stop, 1)

    def picture(self, path: Path) -> None:
        """Write the whole page as PNG."""
        answer = self._ask("Page.captureScreenshot", captureBeyondViewport=True, format="png")
        path.write_bytes(base64.b64decode(answer["data"]))

    def _let_draw(self) -> None:
        self.run("new Promise(r => requestAnimationFrame(() => setTimeout(r, 150)))")

    def _mouse(self, kind: str, at: tuple[float, float], buttons: int) -> None:
        told = {"button": "left", "clickCount": 1} if kind != "mouseMoved" or buttons else {}
        self._ask("Input.dispatchMouseEvent", type=kind, x=at[0], y=at[1], buttons=buttons, **told)

    def _ask(self, method: str, **parameters: Any) -> Any:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return answer["result"]
            self._hear(answer)

    def _next(self) -> Any:
        while b"\0" not in self._rest:
            heard, _, _ = select.select([self._from], [], [], _PATIENCE_S)
            assert heard, "the browser does not answer"
            part = os.read(self._from, 1 << 16)
            assert part, "the browser has gone"
            self._rest += part
        text, _, self._rest = self._rest.partition(b"\0")
        return json.loads(text)

    def _hear(self, event: Any) -> None:
        method, told = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.complaints.append(str(told["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.complaints.append(str([a.get("value", a.get("description")) for a in told["args"]]))
        elif method == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.complaints.append(told["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(told["request"]["url"][:200])
