"""Where the two finders of `flocsim fit` differ on real pictures.

    python -m benchmarks.accuracy.finders [--images DIR] [--markdown]

Flocs found by each, their mean r_eq, and the overlap of the areas: intersection over union of the
pixels of all flocs. The pictures are those listed in docs/images.md.
"""

from pathlib import Path

import numpy as np

from benchmarks.pictures import PICTURES, checked
from benchmarks.reporting import Table, begin
from flocsim.io.images.paper import segment_as_paper
from flocsim.io.images.pictures import segment
from flocsim.io.images.reading import read_grey

CHOSEN = (
    ("safas/brightfield_flocs.png", "bright on black, even light"),
    ("safas/clayflocs.png", "clay, dark on bright"),
    ("safas/clearfloc.png", "one floc"),
    ("safas/darkfield_highgray_mudflocs.png", "mud, dark on bright"),
    ("flocpy/023.png", "mud, strong vignette"),
    ("soot_tem/201805A_A6_004_half.png", "soot, transmission electron microscope"),
)


def covered(found):
    """The pixels of all flocs of a Segmentation, (h, w) bool."""
    seen = np.zeros(found.foreground.shape, bool)
    for each in found.regions:
        top, left, bottom, right = each.bbox
        seen[top:bottom, left:right] |= each.mask[1:-1, 1:-1]
    return seen


def main():
    """Print the table."""
    arguments = begin(__doc__, packages=("scikit-image",), images=PICTURES)
    images = checked(arguments.images, "safas", "flocpy", "soot_tem")
    table = Table(
        "Finders",
        ("picture", "shows", "steepest: flocs", "r_eq [px]", "paper: flocs", "r_eq [px] ",
         "overlap"),
    )  # fmt: skip
    for name, shows in CHOSEN:
        grey = read_grey(images / name)
        found = [segment(grey), segment_as_paper(grey)]
        one, other = map(covered, found)
        overlap = np.count_nonzero(one & other) / max(np.count_nonzero(one | other), 1)
        row = []
        for each in found:
            sizes = [region.equivalent_radius for region in each.regions]
            row += [len(sizes), f"{np.mean(sizes):.1f}" if sizes else "-"]
        table.add(Path(name).stem, shows, *row, f"{overlap:.2f}")
    table.print()


if __name__ == "__main__":
    main()
