"""The page of all that a results file holds, from the schema itself.

Write it anew with `python -m flocsim.io.results.page > docs/results.md`.
"""

from flocsim.io.markdown import markdown_table
from flocsim.io.results.kernel_group import KERNEL
from flocsim.io.results.layout import SCHEMA_VERSION
from flocsim.io.results.schema import (
    COORDINATES,
    DIFFERENCES,
    FLAGS,
    POOLED,
    RADII,
    REPLICATES,
    TABLE,
)

INTRODUCTION = f"""\
# The results file

HDF5, schema version {SCHEMA_VERSION}; a reader refuses versions that it does not know. Every group
holds its own coordinates as dimension scales, every dataset `units` and `long_name`, every code
`flag_values` and `flag_meanings`:

```python
import xarray

table = xarray.open_dataset("study.h5", group="probabilities", engine="h5netcdf")
table["pr_a"].sel(type="I", vertices=64, delta=0.5)
```

Behind the HDF5 data, where HDF5 ignores them, stand blake2b-256 checksums: a table of the pieces
that make up the file, each with its length (u8) and its digest (32 bytes), then a line with the
number of pieces and the digest of the table, both in hexadecimal. flocsim checks all of it, a
piece at a time, before HDF5 parses anything. (Files of earlier versions have one checksum, and are
read as well.) All that may differ between two runs of one config is in the group
`run`: the bytes of every other dataset are the same for any number of ranks, after any number of
interruptions, on processors of one kind ([cluster.md](cluster.md) says what differs between kinds).
(This page is made from the schema by `python -m flocsim.io.results.page`.)
"""

GROUPS = (
    ("probabilities", "(type, vertices, delta), `class` A to D or the kind of `bond` last where "
     "the name has it. Some aggregates stick, others hang by their shapes: pr_a = pr_sticks + "
     "pr_hangs. "
     "`_low` and `_high` bound Wilson's 95 % interval; NaN where there was no event. `_numerical` "
     "is what numerics add on either side (below).", TABLE),
    ("pooled", "(type, vertices): all displacements together. A replicate has the same "
     "orientations at every displacement, so its collisions are correlated; the interval is "
     "Wilson's at the number of independent events that they are worth.", POOLED),
    ("differences", "(against, event, type, vertices, delta): each condition minus the first along "
     "the axis `against` (so 0 there itself). The same replicates in both: Newcombe's paired "
     "interval (method 10).", DIFFERENCES),
    ("replicates", "(type, vertices, delta, replicate): every single collision. `flocsim "
     "trajectory CONFIG --scene TYPE,N,DELTA --replicate K` runs any of them again. Radii and D_0 "
     "are those of the pair: with `scene.pairs = \"measured\"`, or `shapes.size = \"own\"`, each "
     "replicate has its own, the same at all N and δ; so has δ_max, which follows from the two "
     "outlines and angles.", REPLICATES),
)  # fmt: skip

KERNEL_TEXT = """\
(mechanism, vertices, i, j): rates of a kernel study alone ([kernels.md](kernels.md)), the same for
(i, j) and (j, i). `_low` and `_high` bound the 95 % interval of independent scrambles, `_numerical`
is the 95 % bound of what numerics change. Beside it stand `r_eq` [m] along `i`, and the coordinates
`mechanism`, `vertices`, `i` and `j`. In such a file `delta` is 1: every replicate has an offset of
its own.
"""

EFFICIENCY = """\
## The efficiency over the displacements

`flocsim info` and the figure `efficiency` of `flocsim plot` add up the probability P(δ) that an
approach ends aggregated, misses among the approaches, undecided and failed ones left out, over
its sideways offset δ (a share of δ_max), linear between the simulated ones:

- in the plane: E = ∫₀¹ P dδ, of all approaches within the width 2 δ_max;
- axially symmetric: E = ∫₀¹ P 2δ dδ, of all approaches within the area π δ_max². Where P is 1 up
  to y_c and 0 beyond, it is (y_c/δ_max)², the collision efficiency of two settling bodies
  (Pruppacher and Klett 1997, *Microphysics of Clouds and Precipitation*, ch. 14.4; Han and Lawler
  1991, *J. Hydraul. Eng.* 117, 1269).

The bounds are the same sums of Wilson's 95 % bounds at each δ, as wide as where all err together.
There is none where `scene.delta` does not reach from 0 to 1. The numbers follow from the table
`probabilities` (`flocsim.io.results.efficiency`).
"""

NUMERICAL = """\
## The numerical error of a probability

`[integrator] check_share` of the replicates are run again at a 100 times tighter tolerance (fixed
steps: at a quarter of the step); which, follows from the seed and the replicate's index alone. One
that then counts otherwise in a probability, as success, as failure or not at all, has *flipped*:
`n_gained` of them raise the probability and `n_lost` lower it, among `n_checked` that count in
either run. What runs out of steps (five times as many) in its second run has flipped too. The
probabilities are those of the first runs; run more exactly they would change by no more than
flips/trials. `_numerical` is the 95 % bound of that for all trials of the condition,
(f + q)/(c + u): f flips of c that were run again are known, q of the u others are predicted.
With F flips of C in all other conditions of the type, the rate of flips has a gamma distribution
of shape 1 + f and rate (C + 2)/(F + 1) + c (rates of conditions scatter like an exponential
distribution with the mean of the others, by Laplace's rule), flips of the u others have a
negative binomial one, and q is its 95 % quantile. So a condition with few checks borrows from its
type, one with many speaks for itself, and where all is run again nothing is predicted. NaN where
nothing was.

"""

RUN = """\
## run

Scalars. `config` (the file's text), `overrides` (JSON: what the command line laid over it),
`seed`, `preset`; `accuracy` (JSON, with `accuracy = "auto"` alone: what the pilot has chosen for
each type and why: method, tolerance, its replicates, flips and cost at all that was tried, the rate
of flips that is expected); `identity` (JSON: all that the rows follow from, which a resumed run
compares);
`kernel_fingerprint`; versions of flocsim, Python, numpy, numba and h5py; `platform`, `processor`,
`hostname`, `date`, `command`; `ranks`, `sessions` (runs that it took), `history` (JSON: date and
command of those before), `computed` (replicates that the last of them ran), `wall_time` [s];
`warnings` (JSON: lines on what was implausible), `settling` (JSON: type, body i or j, its
equivalent `radius` [m], terminal `speed` [m/s], `reynolds` = 2 r ρ_f v/γ and `stokes` = τ v/r, the
same at every N); `size_classes` (JSON: label, least and largest r_eq `low` and `high` [m] and
number of `flocs` of each class of measured flocs);
`equivalent_spheres` (JSON, of brownian studies: type, `release` and `escape` [m], `diffusion`
[m²/s] of the two against each other, the probabilities to touch `free` of forces between them and
with them, `touch`, and the `stability` ratio; null for what is no number);
`cpus` (JSON: every kind of CPU that rows were computed on: what LLVM calls it, what numba compiled
for, the instructions that numpy used, the C library); `failed` (JSON: up to 1000 failed replicates
with reasons).

## flocs

`floc`: the names of the flocs, in the order of `replicates/floc_i` and `floc_j`.
"""


ENDS = ("_low", "_high", "_numerical")
"""Ends of the names of bounds."""


def results_page() -> str:
    parts = [INTRODUCTION]
    for name, text, schema in GROUPS:
        parts += [f"## {name}\n", f"{text}\n", table(schema)]
    parts += ["## kernel\n", KERNEL_TEXT, table(KERNEL)]
    return "\n".join(
        [*parts, NUMERICAL + EFFICIENCY + "\n" + RUN, "## Coordinates\n", coordinates()]
    )


def table(schema):
    """A Markdown table of one group; bounds go with what they bound."""
    rows = []
    for name, (kind, unit, text) in schema.items():
        if not name.endswith(ENDS):
            shown = ", ".join(
                [f"`{name}`", *(f"`{end}`" for end in ENDS if f"{name}{end}" in schema)]
            )
            rows.append([shown, kind, unit, text + codes(name)])
    return markdown_table(["dataset", "type", "unit", "meaning"], rows) + "\n"


def codes(name):
    if name not in FLAGS:
        return ""
    return ": " + ", ".join(f"{value} {word}" for value, word in zip(*FLAGS[name], strict=True))


def coordinates():
    rows = [[f"`{name}`", text] for name, (_, _, text) in COORDINATES.items()]
    sizes = [[f"`{name}` [m]", text] for name, (_, _, text) in RADII.items()]
    return (
        f"{markdown_table(['axis', 'meaning'], rows)}\n\n"
        "Beside `type`, in `probabilities` and `pooled`, its radii as numbers:\n\n"
        f"{markdown_table(['coordinate', 'meaning'], sizes)}\n"
    )


if __name__ == "__main__":
    print(results_page(), end="")
