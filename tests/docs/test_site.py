"""The site of docs/: built without a warning, its links lead somewhere, a browser shows it."""

import functools
import html
import http.server
import importlib
import importlib.util
import os
import re
import subprocess
import sys
import threading
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest

import flocsim
from flocsim import errors, forces, integrators
from tests.helpers.browser import browser, open_page

ROOT = Path(__file__).resolve().parents[2]


class Links(HTMLParser):
    """What a page links to and loads, and the anchors that it has."""

    def __init__(self, text):
        super().__init__()
        self.links, self.loaded, self.anchors = [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.anchors |= {found.get("id"), found.get("name")} - {None}
        if tag == "a" and "href" in found:
            self.links.append(found["href"])
        elif tag != "a":
            self.loaded += [found[key] for key in ("src", "href") if key in found]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site."""
    for name in ("mkdocs", "material", "mkdocstrings", "latex2mathml"):
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed: pip install 'flocsim[docs]'")
    made = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(made)]
    env = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(words, cwd=ROOT, env=env, capture_output=True, text=True)
    assert done.returncode == 0 and "WARNING" not in done.stderr, done.stderr
    return made


@pytest.fixture(scope="module")
def pages(site):
    """{path: Links} of all pages."""
    return {path: Links(path.read_text("utf-8")) for path in site.rglob("*.html")}


def test_every_link_inside_the_site_leads_somewhere(site, pages):
    broken = []
    checked = 0
    for path, page in pages.items():
        if path.name == "404.html":
            continue  # its links are those of the server's root
        for link in page.links + page.loaded:
            if re.match("[a-z]+:", link) or link.startswith("//"):
                continue
            place, anchor = urldefrag(unquote(link))
            target = (path.parent / place).resolve() if place else path
            checked += 1
            if not target.exists():
                broken.append(f"{path.name}: {link}")
            elif anchor and target in pages and anchor not in pages[target].anchors:
                broken.append(f"{path.name}: {link}: there is no such place on the page")
    assert checked > 500 and not broken, "\n".join(sorted(set(broken)))


def test_nothing_is_loaded_from_elsewhere(pages):
    foreign = {link for page in pages.values() for link in page.loaded
               if re.match("https?:|//", link)}  # fmt: skip
    assert not foreign


def test_every_public_name_has_its_place(site):
    text = "".join(path.read_text("utf-8") for path in (site / "api").glob("*.html"))
    documented = set(re.findall(r'id="(flocsim\.[\w.]+)"', text))
    ends = {name.rpartition(".")[2] for name in documented}
    wanted = {*flocsim.__all__, *forces.__all__, *integrators.__all__}
    own = [value for value in vars(errors).values() if isinstance(value, type)]
    wanted |= {each.__name__ for each in own if each.__module__ == errors.__name__}
    assert wanted - ends <= {"__version__", "open", "Force", "PairForce"}
    assert "open_any" in ends


def test_equations_are_drawn_by_the_browser_itself(site):
    source = (ROOT / "docs" / "physics.md").read_text("utf-8")
    page = (site / "physics.html").read_text("utf-8")
    formulas = re.findall(r"<math .*?</math>", page, re.DOTALL)
    assert len(formulas) == source.count("```math") >= 6
    shown = html.unescape(re.sub(r"<[^>]*>", "", "".join(formulas)))
    assert "\\" not in shown and all(letter in shown for letter in "ΔξκφγωW")


def test_a_browser_shows_the_site(site, tmp_path):
    from PIL import Image

    browser()

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *words):
            pass

    handler = functools.partial(Quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            for name, word in (("index.html", "do they stick?"), ("api/system.html", "energies")):
                url = f"http://127.0.0.1:{server.server_port}/{name}"
                dom, said, picture = open_page(url, tmp_path)
                assert word in dom and not said
                colours = Image.open(picture).convert("RGB").getcolors(2**24)
                assert len(colours) > 50 and max(colours)[0] < 0.98 * 1200 * 2000
        finally:
            server.shutdown()
