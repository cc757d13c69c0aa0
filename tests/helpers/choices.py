"""What the page of `flocsim fit --review` hands back."""

import json
import re


def choices_on(page):
    """The choices on a page before anything is clicked."""
    text = page.read_text("utf-8")
    return json.loads(
        re.search('<script type="application/json" id="choices">(.*?)</script>', text)[1]
    )


def choose(page, changes=(), **other):
    """Write the file that a page saves, with {picture#floc: choice} changed; return its path.

    ``other``: values that every floc gets instead of its own.
    """
    choices = choices_on(page)
    for picture in choices["pictures"]:
        for floc in picture["flocs"]:
            name = f"{picture['picture']}#{floc['floc']}"
            floc |= {"choice": dict(changes).get(name, floc["choice"])} | other
    path = page.with_name("reviewed.json")
    path.write_text(json.dumps(choices))
    return path
