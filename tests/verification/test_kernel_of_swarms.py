"""Swarms aggregate as often as the kernels of their pairs say."""

import math

import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from tests.helpers.example_script import example_script
from tests.helpers.small_study import write_star_library

STUDY = """\
preset = "tang2014"
seed = 5
replicates = {replicates}
[scene]
kind = "{kind}"
{scene}
classes = ["11 um"]
[shapes]
source = "library"
file = "stars.h5"
vertices = [8]
[forces.van_der_waals]
cut = "10 um"
[forces.double_layer]
cut = "10 um"
"""

KERNEL = 'meeting = "settling"\npairs = "measured"'
SWARM = 'number = 200\narea_fraction = 0.02\nduration = "30 ms"\nevery = "1 ms"'
PROOF = 10
"""Milliseconds at the end that only prove contacts."""


@pytest.mark.slow
def test_swarms_aggregate_at_the_rate_of_their_kernel(in_tmp):
    write_star_library("stars.h5", (8,), np.linspace(6.0, 20.0, 24).tolist())
    for kind, scene, replicates in (("kernel", KERNEL, 1024), ("swarm", SWARM, 8)):
        text = STUDY.format(kind=kind, scene=scene, replicates=replicates)
        (in_tmp / f"{kind}.toml").write_text(text, "utf-8")
        assert main([kind, f"{kind}.toml", "--quiet"]) == 0
    example = example_script("kernel_against_swarm")
    kernel, swarm = flocsim.open("kernel.h5").kernel, flocsim.open("swarm.h5")
    flocs = example.Flocs.of(swarm)
    contacts = example.contacts_of(swarm.groups["bonds"])
    times = swarm.scales["time"][:-PROOF]
    clusters, made, chances = example.meetings(contacts, flocs, times)
    aggregated = made[:, -1].sum()
    flocs_expect, spheres_expect = (
        np.sum(chances[:, -1] * kernel.arrays[name][0, 0]) for name in example.KERNELS.values()
    )
    assert aggregated > 150
    # 3 sigma of chance, those of the points of the kernel with it.
    half = kernel.arrays["beta2_high"][0, 0] - kernel.arrays["beta2"][0, 0]
    chance = math.hypot(math.sqrt(flocs_expect), 0.5 * np.sum(chances[:, -1] * half))
    assert abs(aggregated - flocs_expect) < 3.0 * chance
    assert spheres_expect - aggregated > 3.0 * chance
    balance = example.balances(kernel, flocs, times)["flocs"]
    left = clusters / flocs.radius.shape[1]
    assert abs(left[:, -1].mean() - balance[-1]) < 3.0 * chance / flocs.radius.size
