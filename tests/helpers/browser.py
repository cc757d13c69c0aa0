"""A headless Chromium for pages that flocsim writes; tests that want one are skipped without."""

import os
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

from tests.helpers.waiting import PATIENCE

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome", "chrome-headless-shell")
PLAYWRIGHT = ("chromium-*/chrome-linux*/chrome",
              "chromium_headless_shell-*/*/chrome-headless-shell")  # fmt: skip
ROOT_NEEDS = ["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []


@cache
def browser():
    """The path of a Chromium: $FLOCSIM_BROWSER, one on the PATH, or Playwright's."""
    found = os.environ.get("FLOCSIM_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        cached = Path(os.environ.get("PLAYWRIGHT_BROWSERS_PATH", "~/.cache/ms-playwright"))
        kept = [path for name in PLAYWRIGHT for path in sorted(cached.expanduser().glob(name))]
        found = str(kept[-1]) if kept else None
    if found is None:
        pytest.skip("there is no Chromium: install one, or name one in FLOCSIM_BROWSER")
    return found


def open_page(page, folder, *options, width=1200, height=2000):
    """(DOM as text once scripts have run, lines on its console, path of a screenshot) of a page.

    ``page``: a file or a URL.
    """
    url = page if "://" in str(page) else Path(page).resolve().as_uri()
    picture = folder / "screenshot.png"
    common = [browser(), "--headless", "--disable-gpu", *ROOT_NEEDS, "--hide-scrollbars",
              "--no-first-run", "--disable-background-networking", "--enable-logging=stderr",
              f"--user-data-dir={folder / 'profile'}", f"--window-size={width},{height}",
              "--virtual-time-budget=4000", *options]  # fmt: skip
    dom = run([*common, "--dump-dom", url])
    run([*common, f"--screenshot={picture}", url])
    said = re.findall(r":CONSOLE[^\]]*\] (.*)", dom.stderr)
    return dom.stdout, said, picture


def run(command):
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE, encoding="utf-8"
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done
