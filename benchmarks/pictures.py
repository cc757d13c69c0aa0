"""The folder of the real pictures that some benchmarks need: docs/images.md lists them."""

import sys
from pathlib import Path

from flocsim.io.images.masks import read_masks, segment_mask

DEFAULT = Path(__file__).resolve().parents[1] / "images"
SETS = ("flocpy", "safas", "sandi", "soot_tem", "silhouettes")
PICTURES = {
    "default": str(DEFAULT),
    "metavar": "DIR",
    "help": "folder of the pictures listed in docs/images.md (default: images in the checkout)",
}
"""The option --images."""


def checked(images, *sets):
    """The folder of the pictures; ends the program with one line where one of the sets is missing,
    any of all where none is named."""
    folder = Path(images)
    missing = [name for name in sets or SETS if not (folder / name).is_dir()]
    if missing:
        sys.exit(
            f"{folder} has no folder {', '.join(missing)}: "
            "put the pictures listed in docs/images.md there, or name their folder with --images"
        )
    return folder


def silhouettes(images):
    """[(mask, r_eq)] of the real silhouettes."""
    masks = read_masks(Path(images) / "silhouettes/flocs_open.npz")
    regions = [segment_mask(mask, min_radius=0.0).regions[0] for _, mask in masks]
    return [(region.mask, region.equivalent_radius) for region in regions]
