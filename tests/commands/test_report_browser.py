"""The page of `flocsim report` in a headless Chromium: on a phone, in motion, without a network."""

import argparse
import html
import json
import re

import pytest

from flocsim.commands import add_command
from flocsim.ensembles.script_study import Study
from flocsim.io.plots import results as drawings
from flocsim.io.plots import swarm
from tests.helpers.browser import browser, open_page
from tests.helpers.small_study import write_small
from tests.helpers.swarm_study import make_swarm_results

PHONE = 390
"""Pixels; a headless window is 500 wide at least, so the page is opened in a frame."""

FRAME = """<!DOCTYPE html><body><pre></pre><iframe src="{page}" style="width:{width}px;
height:800px;border:0"></iframe><script>
addEventListener('message', (event) => {{
  document.querySelector('pre').textContent = JSON.stringify(event.data);
}});</script></body>"""

REFUSED = """<script>window.refused = [];
addEventListener('securitypolicyviolation', (event) => refused.push(event.blockedURI));</script>"""

PROBE = """<script>
const body = document.querySelector('.body'), before = body.getAttribute('transform');
document.querySelector('.motion button').click();
setTimeout(() => parent.postMessage({
  width: innerWidth, needed: document.documentElement.scrollWidth, refused: window.refused,
  loaded: performance.getEntriesByType('resource').map((entry) => entry.name)
    .filter((name) => !name.startsWith('data:')),
  before, after: body.getAttribute('transform'),
  button: document.querySelector('button').textContent,
  dangling: [...document.querySelectorAll('a')].filter((a) =>
    !document.getElementById(decodeURIComponent(a.hash.slice(1)))).map((a) => a.href),
}, '*'), 500);
</script></body>"""


def write_page(path, figures, module):
    """Write the page of a file with one of its figures, and return it."""
    parser = argparse.ArgumentParser(prog="flocsim")
    add_command(parser.add_subparsers(), "report")
    page = path.with_suffix(".html")
    args = parser.parse_args(["report", str(path), "--output", str(page)])
    name = next(name for name in vars(module) if name.endswith("FIGURES"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, name, {each: getattr(module, name)[each] for each in figures})
        assert args.run(args) == 0
    return page


@pytest.fixture(scope="module", params=["pair", "swarm"])
def page(request, tmp_path_factory):
    """The page of a small study of pairs of spheres, and of a swarm."""
    browser()
    folder = tmp_path_factory.mktemp(request.param)
    path = folder / "r.h5"
    if request.param == "pair":
        Study(write_small(folder, vertices="[1]")).run(output=path)
        return write_page(path, ["outcomes"], drawings)
    swarms = make_swarm_results()
    swarms.groups["snapshots"]["position"][:, 1, 0, 0] += 1e-6  # the first body leaves the others
    swarms.write(path)
    return write_page(path, ["snapshots"], swarm)


@pytest.fixture(scope="module")
def seen(page, tmp_path_factory):
    """What a probe on a phone's width has found, and the lines on the console."""
    folder = tmp_path_factory.mktemp("browser")
    text = page.read_text("utf-8").replace("</title>", f"</title>{REFUSED}")
    (folder / "page.html").write_text(text.replace("</body>", PROBE), "utf-8")
    frame = FRAME.format(page="page.html", width=PHONE)
    (folder / "frame.html").write_text(frame, "utf-8")
    dom, said, _ = open_page(folder / "frame.html", folder)
    return json.loads(html.unescape(re.search("<pre>(.*?)</pre>", dom)[1])), said


def test_a_page_fits_a_phone(seen):
    found, _ = seen
    assert found["width"] == PHONE and found["needed"] <= PHONE


def test_a_page_loads_nothing_and_has_no_error(seen):
    found, said = seen
    assert not said and not found["loaded"] and not found["refused"]


def test_play_moves_an_outline(seen):
    found, _ = seen
    assert found["button"] == "Pause"
    assert "translate" in found["before"] and found["after"] != found["before"]


def test_each_link_leads_to_a_definition(seen):
    found, _ = seen
    assert not found["dangling"]


def test_a_page_shows_colours_at_a_desk(page, tmp_path):
    from PIL import Image

    _, said, picture = open_page(page, tmp_path, height=3000)
    assert not said
    colours = Image.open(picture).convert("RGB").getcolors(2**24)
    assert len(colours) > 100 and max(colours)[0] < 0.98 * 1200 * 3000
