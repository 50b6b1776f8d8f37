"""Chromium with software rendering and Firefox of this machine, driven by Playwright."""

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PROGRAMS = {"chromium": ("chromium", "chromium-browser", "google-chrome"), "firefox": ("firefox-esr", "firefox")}
_DARK = {"layout.css.prefers-color-scheme.content-override": 0}  # of Firefox, which does not hear `color_scheme`
_HOW: dict[str, dict[str, Any]] = {
    "chromium": {"args": ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]},
    "firefox": {"channel": "moz-firefox", "firefox_user_prefs": _DARK},  # its own protocol, without a patched build
}


@contextlib.contextmanager
def driver() -> Iterator[Any]:
    """Playwright, which takes Firefox as it is; ImportError where there is none."""
    from playwright import sync_api

    before = os.environ.get("NODE_OPTIONS", "")
    os.environ["NODE_OPTIONS"] = f"{before} --require={Path(__file__).with_name('_firefox.cjs')}"
    try:
        with sync_api.sync_playwright() as found:
            yield found
    finally:
        os.environ["NODE_OPTIONS"] = before


def launched(driver: Any, name: str) -> Any:
    """A browser; FileNotFoundError, which says what installs it, where this machine has none."""
    program = next(filter(None, map(shutil.which, PROGRAMS[name])), None)
    if program is None:
        raise FileNotFoundError(f"needs {name}: apt-get install {PROGRAMS[name][0]}")
    return getattr(driver, name).launch(executable_path=program, **_HOW[name])
