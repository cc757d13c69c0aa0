"""`flocsim report`: one page that needs no other file, with the numbers of the results file."""

import argparse
import base64
import html
import json
import re
import shutil
from html.parser import HTMLParser

import numpy as np
import pytest

import flocsim
from flocsim.commands import add_command
from flocsim.ensembles.contents import info_of
from flocsim.ensembles.script_study import Study
from flocsim.errors import FileError, UsageError, visible
from flocsim.io.plots import results as drawings
from flocsim.io.plots.results import FIGURES
from flocsim.io.results.file import instructive_of_each, read_results
from flocsim.io.results.run_group import provenance
from flocsim.io.results.schema import OUTCOMES
from tests.helpers.results_files import write_results
from tests.helpers.small_study import write_small
from tests.helpers.synthetic_results import make_results
from tests.helpers.tiers import rest_slow

HOSTILE = "<script>document.title='taken'</script><img src=x onerror=alert(1)>'\"&"


def call(*words):
    """Parse the words as the `flocsim` command does, and run."""
    parser = argparse.ArgumentParser(prog="flocsim")
    add_command(parser.add_subparsers(), "report")
    args = parser.parse_args(["report", *map(str, words)])
    return args.run(args)


class Page(HTMLParser):
    """What a page links to, and its tags."""

    def __init__(self, text):
        super().__init__()
        self.links, self.ids, self.tags = [], set(), []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.tags.append(tag)
        self.links += [found[name] for name in ("src", "href", "data", "action") if name in found]
        self.ids |= {found.get("id")}


def write_made_up(path):
    """Results that were made up, with hostile words in all that is text."""
    run = provenance(f'preset = "si"\n# {HOSTILE}\n', 3) | {"wall_time": 12.3, "ranks": 2}
    run |= {"warnings": json.dumps([f"4 m/s {HOSTILE}"]), "command": HOSTILE}
    made = make_results((HOSTILE, "II"), vertices=(1, 4), delta=(0.0, 1.0), count=12, run=run)
    write_results(path, made)


@pytest.fixture
def made_up(in_tmp, one_figure):
    """The folder of made-up results; their page has one figure."""
    write_made_up("r.h5")
    return in_tmp


FEW = ("4", "overview", "size")


@pytest.fixture(
    scope="module", params=rest_slow([[*FEW], [*FIGURES]], lambda names: len(names) == 3)
)
def whole(request, tmp_path_factory):
    """(results file, text of its page, how many figures it has) without motion; the page of every
    figure in the slow run."""
    path = tmp_path_factory.mktemp("whole") / "r.h5"
    write_made_up(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawings, "FIGURES", {name: FIGURES[name] for name in request.param})
        assert call(path, "--no-motion", "--output", path.with_suffix(".html")) == 0
    return path, path.with_suffix(".html").read_text("utf-8"), len(request.param)


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """(path, page) of a small study of spheres, with motion."""
    folder = tmp_path_factory.mktemp("real")
    results = Study(write_small(folder, vertices="[1]")).run(output=folder / "small.h5")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawings, "FIGURES", {name: FIGURES[name] for name in FEW})
        assert call(results.path, "--output", folder / "small.html") == 0
    return results.path, folder / "small.html"


def test_the_page_needs_nothing_else_and_has_three_figures(whole):
    _, text, count = whole
    found = Page(text)
    assert all(link.startswith(("data:image/svg+xml;base64,", "#")) for link in found.links)
    assert {link[1:] for link in found.links if link.startswith("#")} <= found.ids
    pictures = [link for link in found.links if link.startswith("data:")]
    assert len(pictures) == min(count, 3)
    assert all(b"<svg" in base64.b64decode(each.partition(",")[2]) for each in pictures)
    assert "@import" not in text and "url(" not in text


def test_the_page_shows_what_info_prints(whole):
    path, text, _ = whole
    assert html.escape(visible(info_of(path))) in text


def test_what_a_file_says_of_itself_cannot_become_code(whole):
    _, text, _ = whole
    assert HOSTILE not in text and html.escape(HOSTILE) in text
    assert Page(text).tags.count("script") == 1 and "onerror" not in re.sub("&lt;.*", "", text)
    assert "default-src 'none'; img-src data:" in text


def test_a_page_is_replaced_only_when_asked_to(made_up, capsys):
    assert call("r.h5", "--no-motion") == 0
    assert capsys.readouterr().out == "r.html\n"
    first = (made_up / "r.html").read_bytes()
    with pytest.raises(UsageError, match="already exists and is left as it is"):
        call("r.h5", "--no-motion")
    call("r.h5", "--no-motion", "--overwrite")
    assert (made_up / "r.html").read_bytes() == (made_up / "r.1.html").read_bytes() == first


def test_wrong_names_are_refused(made_up):
    with pytest.raises(UsageError, match=r"must end in \.html"):
        call("r.h5", "--output", "r.pdf")
    with pytest.raises(FileError, match=r"absent\.h5"):
        call("absent.h5")


def test_the_replicate_shown_is_near_the_upper_quartile_of_its_class(made_up):
    results = read_results("r.h5")
    outcome = results.replicates["outcome"]
    times = results.replicates["t_end"] - results.replicates["t_collision"]
    found = instructive_of_each(results)
    assert list(found) == [name for code, name in enumerate("ABCD") if np.any(outcome == code)]
    for name, (place, _) in found.items():
        of_class = outcome == OUTCOMES.index(name)
        most = max(v for v in range(len(results.vertices)) if of_class[:, v].any())
        times_there = times[:, most][of_class[:, most]]
        assert place[1] == most and outcome[place] == OUTCOMES.index(name)
        assert abs(times[place] - np.quantile(times_there, 0.75)) == pytest.approx(
            np.abs(times_there - np.quantile(times_there, 0.75)).min()
        )


def test_a_page_of_two_files_has_the_answers_first(made_up):
    shutil.copy("r.h5", "s.h5")
    assert call("r.h5", "s.h5", "--no-motion", "--output", "both.html") == 0
    text = (made_up / "both.html").read_text("utf-8")
    assert text.count("<h1") == 2 and text.rindex("<h1") < text.index("<section")
    assert {"figures", "figures1", "table", "table1"} <= Page(text).ids


def test_what_cannot_be_run_again_is_said(made_up, capsys):
    assert call("r.h5") == 0
    said = capsys.readouterr().out
    assert " not animated: " in said and said.endswith("r.html\n")
    assert "Not shown in motion: " in (made_up / "r.html").read_text("utf-8")


def test_motion_is_that_of_the_replicate(real):
    path, file = real
    text = file.read_text("utf-8")
    found = instructive_of_each(read_results(path))
    motions = [json.loads(html.unescape(each))
               for each in re.findall(r"data-frames='([^']*)'", text)]  # fmt: skip
    assert len(motions) == len(found) > 0
    opened = flocsim.open(path)
    for ((t, v, d, k), _), motion in zip(found.values(), motions, strict=True):
        run = opened.replicate(k, opened.types[t], int(opened.vertices[v]), float(opened.delta[d]))
        pose = np.array(motion["pose"])
        assert motion["t"][0] == run.t[0] and motion["t"][-1] == pytest.approx(run.t[-1], rel=1e-5)
        np.testing.assert_allclose(
            pose[-1, 1, :2], 1e6 * (run.position[-1, 1, :2] - run.position[-1, 0, :2]), rtol=1e-5
        )
        shown = motion["shown"]
        assert motion["t"][shown] == pytest.approx(run.row["t_collision"], rel=1e-2)
        lengths = {
            len(motion[key]) for key in ("t", "eye", "pose", "distance", "contacts", "words")
        }
        assert lengths == {len(motion["t"])}
        assert f"d_c = {1e6 * run.row['d_c_last']:.4g} µm" in motion["words"][-1]
