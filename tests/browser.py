"""A browser that tests drive, where Chromium is installed: the DevTools protocol over pipes."""

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")


class Tab:
    """An open page."""

    def __init__(self, commands: int, answers: int) -> None:
        self._commands, self._answers = os.fdopen(commands, "wb"), os.fdopen(answers, "rb")
        self._number, self._rest, self._session = 0, b"", ""

    def call(self, method: str, **params: object) -> dict[str, Any]:
        """Call a method of the protocol and wait for its answer."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        self._commands.write(json.dumps(message).encode() + b"\0")
        self._commands.flush()
        while (answer := self._next()).get("id") != self._number:
            pass
        assert "error" not in answer, answer
        result: dict[str, Any] = answer["result"]
        return result

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            more = os.read(self._answers.fileno(), 1 << 16)
            assert more, "the browser ended"
            self._rest += more
        text, _, self._rest = self._rest.partition(b"\0")
        answer: dict[str, Any] = json.loads(text)
        return answer

    def open(self, page: Path, *, width: int) -> None:
        """Open a file, and wait until its scripts have run."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        self.call("Page.navigate", url=page.resolve().as_uri())
        self.run(
            "new Promise((done) => { const look = () => document.readyState === 'complete' && location.href !== "
            "'about:blank' ? done() : setTimeout(look, 20); look(); })"
        )

    def run(self, script: str) -> Any:
        """Evaluate an expression in the page."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def press(self, key: str) -> None:
        """Press a key where the focus is."""
        codes = {"ArrowRight": 39, "ArrowLeft": 37, "End": 35, "Home": 36, "Tab": 9}
        for kind in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=codes[key])

    def close(self) -> None:
        """Close both pipes."""
        self._commands.close()
        self._answers.close()


@contextmanager
def browser() -> Iterator[Tab]:
    """Start a browser, with its own files in a folder that is gone afterwards."""
    assert CHROMIUM is not None
    # Its sockets need a short path.
    profile = tempfile.mkdtemp()
    from_us, to_browser = os.pipe()
    from_browser, to_us = os.pipe()
    flags = f"--headless --no-sandbox --disable-gpu --user-data-dir={profile} --remote-debugging-pipe"
    command = f'exec "{CHROMIUM}" {flags} 3<&{from_us} 4>&{to_us}'
    process = subprocess.Popen(
        ["bash", "-c", command],
        env={**os.environ, "TMPDIR": profile},
        pass_fds=(from_us, to_us),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(from_us)
    os.close(to_us)
    tab = Tab(to_browser, from_browser)
    try:
        yield tab
    finally:
        process.kill()
        process.wait()
        tab.close()
        shutil.rmtree(profile, ignore_errors=True)
