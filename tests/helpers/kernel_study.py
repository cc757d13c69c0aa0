"""Small kernel studies: of spheres, whose engine the tests of collisions share."""

from flocsim.ensembles.config.loader import load_any_config

KERNEL = """\
preset = "{preset}"
seed = 3
replicates = {replicates}
[scene]
kind = "kernel"
meeting = {meeting}
{scene}
sizes = {sizes}
scrambles = {scrambles}
[shapes]
vertices = {vertices}
{more}
[output]
file = "kernel.h5"
"""

USUAL = {
    "preset": "si",
    "replicates": 32,
    "meeting": '["settling"]',
    "scene": "",
    "sizes": '["10 um", "20 um"]',
    "scrambles": 4,
    "vertices": "[1]",
    "more": "",
}


def kernel_text(**changes):
    """The config of a small kernel study."""
    return KERNEL.format(**(USUAL | changes))


def kernel_config(folder, **changes):
    """Its Config, from a file in the folder."""
    path = folder / "kernel.toml"
    path.write_text(kernel_text(**changes), "utf-8")
    return load_any_config(path)
