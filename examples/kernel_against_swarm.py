"""Kernels of pairs against the counts of swarms: how many flocs are left, and which have met.

    flocsim kernel examples/settling_kernel.toml
    flocsim swarm examples/settling_swarm.toml
    python examples/kernel_against_swarm.py settling_kernel.h5 settling_swarm.h5

Smoluchowski's balance in the plane, n per area: dn_c/dt = ½ Σ β_ab n_a n_b − n_c Σ β_ca n_a, the
first sum over all a and b that make c. A class c is a composition, how many flocs of each size
class hang together, so that nothing is shared between pivots. For single flocs β is the kernel
file's. For clusters it is assumed: efficiency · 2 (R_a + R_b) |V_a − V_b| with R = √Σ r², their
area kept, V = Σ r w/Σ r, as each body has Stokes's drag ∝ r of its own, and the efficiency of the
size class nearest to R.
"""

import argparse
import itertools

import attrs
import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.special import stdtrit

import flocsim

LARGEST = 8
"""Flocs of the largest cluster whose meetings are followed."""

DRAWS = 400
"""Clusters of each composition whose speeds are compared."""

SAME = 1e-9
"""Share by which the radii of one floc may differ, by rounding."""

STAYS = (1, 3)
"""Kinds of bonds whose attraction outweighs all that pulls at them: certificate, rest."""


@attrs.frozen(eq=False)
class Contacts:
    """Contacts that have proved to last: in which ``replicate``, between which ``bodies`` (m, 2),
    from the snapshot ``first`` at which they touched to before that of ``stop``."""

    replicate: np.ndarray
    bodies: np.ndarray
    first: np.ndarray
    stop: np.ndarray

    def clusters(self, replicate, place, count):
        """(how many clusters, the cluster of each of ``count`` bodies) at a snapshot."""
        there = (self.replicate == replicate) & (self.first <= place) & (place < self.stop)
        a, b = self.bodies[there].T
        graph = coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
        return connected_components(graph, directed=False)


def contacts_of(bonds):
    """The Contacts in the group `bonds` of a swarm: pairs that touch from snapshot to snapshot,
    where one of these says that attraction holds them. Kernels call that aggregated."""
    names = "replicate", "later", "earlier", "time"
    rows = np.column_stack([bonds[f"bond_{name}"] for name in names]).astype(int)
    order = np.lexsort(rows.T[::-1])
    rows, stays = rows[order], np.isin(bonds["bond_kind"][order], STAYS)
    steps = np.diff(rows, axis=0)
    begins = np.flatnonzero(np.r_[True, steps[:, :3].any(axis=1) | (steps[:, 3] != 1)])
    ends = np.r_[begins[1:], len(rows)] - 1
    lasts = np.maximum.reduceat(stays, begins)
    begins, ends = begins[lasts], ends[lasts]
    return Contacts(rows[begins, 0], rows[begins, 1:3], rows[begins, 3], rows[ends, 3] + 1)


@attrs.frozen(eq=False)
class Flocs:
    """The flocs of all swarms: ``radius`` [m], ``speed`` at which each settles alone [m/s], and
    ``kind``, its size class, all (replicate, body); ``area`` (replicate,) of the boxes [m²]."""

    radius: np.ndarray
    speed: np.ndarray
    kind: np.ndarray
    area: np.ndarray

    @classmethod
    def of(cls, swarm):
        radius = swarm.groups["bodies"]["r_eq"]
        # A swarm begins with every floc at its own speed.
        speed = -swarm.groups["snapshots"]["velocity"][:, 0, :, 1]
        kind = np.searchsorted(swarm.scales["class"][1:], radius, side="right")
        return cls(radius, speed, kind, swarm.groups["bodies"]["box"].prod(axis=1))

    def unlike(self, replicate, chosen):
        """How many pairs (class, class) of chosen flocs there are, those of one size left out: they
        never meet, and the kernel is a mean over all others."""
        radius, kind = self.radius[replicate][chosen], self.kind[replicate][chosen]
        member = np.eye(self.kind.max() + 1)[kind]
        differs = np.abs(radius[:, None] - radius) > SAME * radius
        pairs = member.T @ differs @ member
        return pairs - 0.5 * np.diag(np.diag(pairs))


def meetings(contacts, flocs, times):
    """(clusters (replicate, time), pairs of single flocs that have aggregated by then
    (replicate, time, class, class), how long pairs of single flocs were there, over the area of
    their box, until then [s/m²], the same way)."""
    many, n = flocs.radius.shape
    classes = flocs.kind.max() + 1
    clusters = np.zeros((many, len(times)))
    made = np.zeros((many, len(times), classes, classes))
    chances = np.zeros_like(made)
    for replicate, place in np.ndindex(clusters.shape):
        clusters[replicate, place], label = contacts.clusters(replicate, place, n)
        if place + 1 == len(times):
            continue
        single = np.bincount(label)[label] == 1
        pairs = flocs.unlike(replicate, single)
        chances[replicate, place + 1] = (
            pairs * (times[place + 1] - times[place]) / flocs.area[replicate]
        )
        new = (contacts.replicate == replicate) & (contacts.first == place + 1)
        met = contacts.bodies[new]
        kinds = np.sort(flocs.kind[replicate][met[single[met].all(axis=1)]], axis=1)
        np.add.at(made[replicate, place + 1], tuple(kinds.T), 1.0)
    return clusters, made.cumsum(axis=1), np.triu(chances.cumsum(axis=1))


def quickening(contacts, flocs, velocity, times):
    """Mean speed of two single flocs against each other, over that at which they settle alone
    (class, class): those that have just parted from others do not yet have their own speed again.

    ``velocity`` (replicate, time, body, 3) [m/s].
    """
    many, n = flocs.radius.shape
    sums = np.zeros((2, flocs.kind.max() + 1, flocs.kind.max() + 1))
    for replicate, place in np.ndindex(many, len(times)):
        label = contacts.clusters(replicate, place, n)[1]
        single = np.bincount(label)[label] == 1
        member = np.eye(len(sums[0]))[flocs.kind[replicate][single]]
        x, y = velocity[replicate, place, single, :2].T
        own = flocs.speed[replicate][single]
        for which, (u, v) in enumerate(((x, y), (0.0 * own, own))):
            apart = np.hypot(u[:, None] - u, v[:, None] - v)
            sums[which] += member.T @ apart @ member
    return sums[0] / sums[1]


def half_width(values):
    """Half the 95 % interval of the mean over replicates, the first axis."""
    many = len(values)
    return stdtrit(many - 1, 0.975) * values.std(axis=0, ddof=1) / np.sqrt(many)


def ratio(above, below):
    """(Σ above/Σ below, half its 95 % interval) of what each replicate gave."""
    found = above.sum(axis=0) / below.sum(axis=0)
    return found, half_width(above - found * below) / below.mean(axis=0)


def compositions(classes, largest=LARGEST):
    """How many flocs of each class a cluster has (c, classes): all of up to so many flocs, single
    ones first."""
    all_of_them = itertools.product(range(largest + 1), repeat=classes)
    chosen = [each for each in all_of_them if 1 <= sum(each) <= largest]
    return np.array(sorted(chosen, key=lambda each: (sum(each), [-many for many in each])))


def made_of(parts):
    """Which composition two of them make (c, c); their number where that is larger than all."""
    place = {tuple(each): k for k, each in enumerate(parts.tolist())}
    return np.array([[place.get(tuple(a + b), len(parts)) for b in parts] for a in parts])


def kernel_of_clusters(parts, kernel, efficiency, radii, flocs):
    """β (c, c) [m²/s]: ``kernel`` and ``efficiency`` (class, class) are those of single flocs, of
    ``radii`` [m]."""
    rng = np.random.default_rng(0)
    sums = np.zeros((3, len(parts), DRAWS))
    for k, kind in np.ndindex(parts.shape):
        drawn = rng.choice(np.flatnonzero(flocs.kind == kind), (parts[k, kind], DRAWS))
        r, w = flocs.radius.flat[drawn], flocs.speed.flat[drawn]
        sums[:, k] += np.sum([r**2, r, r * w], axis=1)
    radius, speed = np.sqrt(sums[0]), sums[2] / sums[1]
    near = np.abs(np.log(radius.mean(axis=1)[:, None] / radii)).argmin(axis=1)
    beta = np.array([
        np.mean(2.0 * (radius[k] + radius) * np.abs(speed[k] - speed), axis=1)
        for k in range(len(parts))
    ])  # fmt: skip
    beta = 0.5 * (beta + beta.T) * efficiency[np.ix_(near, near)]
    beta[: len(radii), : len(radii)] = kernel
    return beta


def decline(beta, parts, start, times):
    """Numbers per area (time, c + 1) [m⁻²] of compositions, begun with ``start`` single flocs of
    each class; the last are clusters too large to be followed, which meet no others."""
    target = made_of(parts).ravel()
    begin = np.zeros(len(parts) + 1)
    begin[: len(start)] = start

    def rate(_, n):
        meet = beta * np.outer(n[:-1], n[:-1])
        gain = np.bincount(target, 0.5 * meet.ravel(), len(n))
        gain[:-1] -= meet.sum(axis=1)
        return gain

    found = solve_ivp(rate, (times[0], times[-1]), begin, t_eval=times, rtol=1e-7, atol=1e-3)
    if not found.success:
        raise SystemExit(f"the balance was not solved: {found.message}")
    return found.y.T


KERNELS = {"flocs": "beta2", "spheres, α = 1": "beta2_reference"}
"""What two flocs meet by → its name in the file."""


def balances(kernel, flocs, times):
    """{label: clusters over flocs (time,)} of the balance with each of the KERNELS."""
    count = len(kernel.radii)
    parts = compositions(count)
    area = flocs.area.mean()
    number = np.array([np.mean((flocs.kind == each).sum(axis=1)) for each in range(count)])
    every = np.ones(flocs.radius.shape[1], bool)
    pairs = np.mean([flocs.unlike(each, every) for each in range(len(flocs.area))], axis=0)
    share = np.diag(pairs) / (0.5 * number**2)
    found = {}
    for label, name in KERNELS.items():
        alone = kernel.arrays[name][0, -1]
        efficiency = alone / kernel.arrays["beta2_reference"][0, -1]
        alone = np.where(np.eye(count, dtype=bool), alone * share, alone)
        beta = kernel_of_clusters(parts, alone, efficiency, kernel.radii, flocs)
        n = decline(beta, parts, number / area, times)
        found[label] = n.sum(axis=1) * area / number.sum()
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("kernel", help="file that flocsim kernel wrote, of settling flocs")
    parser.add_argument("swarm", help="file that flocsim swarm wrote, of the same flocs")
    words = "milliseconds at the end that only prove contacts, which are not counted there"
    parser.add_argument("--proof", type=float, default=10.0, help=words)
    words = "milliseconds until which pairs of single flocs that aggregate are counted"
    parser.add_argument("--early", type=float, default=20.0, help=words)
    parser.add_argument("--figure", default="kernel_against_swarm.png")
    args = parser.parse_args()
    kernel, swarm = flocsim.open(args.kernel).kernel, flocsim.open(args.swarm)
    flocs = Flocs.of(swarm)
    if len(swarm.scales["class"]) != len(kernel.radii):
        raise SystemExit("the two files are of other size classes: give both the same")
    last = swarm.scales["time"][-1] - 1e-3 * args.proof
    times = swarm.scales["time"][swarm.scales["time"] <= last * (1.0 + 1e-9)]
    if not np.isin(swarm.groups["bonds"]["bond_kind"], STAYS).any():
        raise SystemExit("no pair aggregated in these swarms: give them more time, or more flocs")
    contacts = contacts_of(swarm.groups["bonds"])
    clusters, made, chances = meetings(contacts, flocs, times)
    left = clusters / flocs.radius.shape[1]
    curves = balances(kernel, flocs, times)
    early = np.searchsorted(times, 1e-3 * args.early * (1.0 + 1e-9), side="right") - 1
    met = made[:, early], chances[:, early]
    velocity = swarm.groups["snapshots"]["velocity"]
    quicker = quickening(contacts, flocs, velocity, times[: early + 1])
    print(f"pairs of single flocs that aggregated until {1e3 * times[early]:.0f} ms")
    report(kernel, met, quicker)
    for place in np.linspace(0, len(times) - 1, 7).astype(int):
        numbers = ", ".join(f"{label}: {curve[place]:.3f}" for label, curve in curves.items())
        found = f"{left[:, place].mean():.3f} ± {half_width(left)[place]:.3f}"
        print(f"{1e3 * times[place]:.0f} ms: clusters/flocs {found}; balances, {numbers}")
    draw(kernel, (times, left, curves), (times[early], *met), args.figure)


def compared(kernel, made, chances):
    """[(pair of classes, how many aggregated in all swarms, (that over what is expected, half the
    95 % interval) of each of the KERNELS)], the last of all pairs."""
    classes = range(len(kernel.radii))
    chosen = [((i, j),) for i, j in itertools.combinations_with_replacement(classes, 2)]
    rows = []
    for pairs in (*chosen, [each for (each,) in chosen]):
        i, j = np.transpose(pairs)
        found = [over_expected(kernel, name, made[:, i, j], chances[:, i, j], (i, j))
                 for name in KERNELS.values()]  # fmt: skip
        label = "all" if len(pairs) > 1 else f"{i[0] + 1}-{j[0] + 1}"
        rows.append((label, made[:, i, j].sum(), *found))
    return rows


def over_expected(kernel, name, made, chances, pairs):
    """(what aggregated over what a kernel expects, half the 95 % interval, the kernel's own with
    it, as if all pairs of classes erred alike); both (replicate, pair)."""
    beta = kernel.arrays[name][0, -1][pairs]
    low, high = (kernel.arrays.get(f"{name}_{end}", kernel.arrays[name])[0, -1][pairs]
                 for end in ("low", "high"))  # fmt: skip
    found, half = ratio(made.sum(axis=1), (beta * chances).sum(axis=1))
    chance = chances.mean(axis=0)
    own = 0.5 * (high - low) @ chance / (beta @ chance)
    return found, np.hypot(half, found * own)


def report(kernel, met, quicker):
    """Print how many pairs aggregated, over what the kernels expect."""
    names = ", ".join(f"{k + 1}: {label}" for k, label in enumerate(kernel.labels))
    print(f"  size classes {names}")
    faster = quicker[np.triu_indices_from(quicker)]
    faster = [f"; speeds over those alone {each:.2f}" for each in faster]
    for (name, count, *found), speed in zip(compared(kernel, *met), [*faster, ""], strict=True):
        numbers = (f"{label}: {value:.2f} ± {half:.2f}"
                   for label, (value, half) in zip(KERNELS, found, strict=True))  # fmt: skip
        print(f"  {name}: {count:.0f}; over kernels of {', '.join(numbers)}{speed}")


def draw(kernel, decline_of, counted, path):
    """Clusters over time, and how many pairs aggregated over how many are expected to."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    (times, left, curves), (until, *met) = decline_of, counted
    figure, (one, two) = plt.subplots(1, 2, figsize=(7.4, 2.9), layout="constrained")
    colours = ("#0072B2", "#D55E00")
    half = half_width(left)
    mean = left.mean(axis=0)
    one.fill_between(1e3 * times, mean - half, mean + half, color="0.75", lw=0)
    one.plot(1e3 * times, mean, color="0.2", label=f"{len(left)} swarms")
    for colour, (label, curve) in zip(colours, curves.items(), strict=True):
        one.plot(1e3 * times, curve, "--", color=colour, label=f"balance, {label}")
    one.set_xlabel("time [ms]")
    one.set_ylabel("clusters over flocs")
    one.set_ylim(top=1.0)
    one.legend(frameon=False)
    rows = compared(kernel, *met)
    places = np.arange(len(rows))
    two.axhline(1.0, color="0.6", lw=0.8)
    for number, (colour, label) in enumerate(zip(colours, KERNELS, strict=True)):
        values = np.array([row[2 + number] for row in rows])
        two.errorbar(places + 0.2 * (number - 0.5), values[:, 0], values[:, 1], fmt="os"[number],
                     ms=4, color=colour, label=f"kernel, {label}", capsize=2, lw=1)  # fmt: skip
    two.set_xticks(places, [row[0] for row in rows])
    two.set_xlabel("size classes of the two")
    two.set_ylabel(f"pairs aggregated in {1e3 * until:.3g} ms\nover those expected")
    two.set_ylim(bottom=0.0)
    two.legend(frameon=False, loc="lower left")
    for axes in (one, two):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=200, metadata={"Software": None})
    print(path)


if __name__ == "__main__":
    main()
