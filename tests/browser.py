"""A headless browser for tests of live pages, driven by the DevTools protocol; none installed: the test is skipped."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
from tornado.websocket import websocket_connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")


def look(url: str, until: str, folder: Path, seconds: float = 60.0, picture: Path | None = None) -> Any:
    """Open `url` and return the value of the JavaScript expression `until` once it is true, or its last value.

    folder: for the browser's profile. picture: PNG of the page then.
    """
    program = next((found for name in NAMES if (found := shutil.which(name))), None)
    if program is None:
        pytest.skip("no chromium is installed")
    command = [program, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0",
               f"--user-data-dir={folder}", "--window-size=1050,2200", "about:blank"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as browser:
        try:
            return asyncio.run(_look(_port(folder), url, until, time.monotonic() + seconds, picture))
        finally:
            browser.terminate()


def _port(folder: Path) -> int:
    """The port that the browser chose."""
    told, end = folder / "DevToolsActivePort", time.monotonic() + 30
    while not told.exists() or not told.read_text().strip():
        assert time.monotonic() < end, "the browser did not start"
        time.sleep(0.1)
    return int(told.read_text().split()[0])


async def _look(port: int, url: str, until: str, end: float, picture: Path | None) -> Any:
    with urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
        target = next(t for t in json.load(answer) if t["type"] == "page")
    socket = await websocket_connect(target["webSocketDebuggerUrl"], max_message_size=100_000_000)
    count = 0

    async def call(method: str, **parameters: Any) -> dict[str, Any]:
        nonlocal count
        count += 1
        await socket.write_message(json.dumps({"id": count, "method": method, "params": parameters}))
        while True:
            message = json.loads(await socket.read_message() or "{}")
            if message.get("id") == count:
                result: dict[str, Any] = message["result"]
                return result

    await call("Page.navigate", url=url)
    value = None
    while not value and time.monotonic() < end:
        await asyncio.sleep(0.3)
        found = await call("Runtime.evaluate", expression=until, returnByValue=True)
        value = found["result"].get("value")
    if picture is not None:
        await asyncio.sleep(0.5)
        shot = await call("Page.captureScreenshot", format="png")
        picture.write_bytes(base64.b64decode(shot["data"]))
    socket.close()
    return value
