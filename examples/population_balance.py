"""A Smoluchowski population balance with kernels of shapes, against spheres that always stick.

    flocsim kernel examples/kernel.toml
    python examples/population_balance.py kernel.h5 --figure population_balance.png

Size classes are those of the file; what two of them become is shared between the two classes next
to it so that number and volume are kept (fixed pivots: Kumar and Ramkrishna 1996, Chem. Eng. Sci.
51, 1311). dn_k/dt = ½ Σ_ij η_kij β_ij n_i n_j − n_k Σ_j β_kj n_j.
"""

import argparse

import numpy as np
from scipy.integrate import solve_ivp

import flocsim


def shares(volume):
    """η (k, i, j): what of a floc of volume v_i + v_j counts for class k.

    What is larger than the largest class goes into it, its volume kept.
    """
    n = len(volume)
    eta = np.zeros((n, n, n))
    for i in range(n):
        for j in range(n):
            v = volume[i] + volume[j]
            k = int(np.searchsorted(volume, v, side="right")) - 1
            if k == n - 1:
                eta[k, i, j] = v / volume[k]
            else:
                upper = (v - volume[k]) / (volume[k + 1] - volume[k])
                eta[k, i, j], eta[k + 1, i, j] = 1.0 - upper, upper
    return eta


def grow(beta, volume, start, times):
    """Numbers n (times, classes) [m⁻³] of a suspension that begins with ``start``."""
    eta = shares(volume)

    def rate(_, n):
        meet = beta * np.outer(n, n)
        return 0.5 * np.einsum("kij,ij->k", eta, meet) - meet.sum(axis=1)

    found = solve_ivp(rate, (times[0], times[-1]), start, "LSODA", times, rtol=1e-8, atol=1e-4)
    if not found.success:
        raise SystemExit(f"the balance was not solved: {found.message}")
    return found.y.T


def kernels(kernel, vertices):
    """(β of shapes that meet and stick, β of spheres that always do) [m³/s], mechanisms added."""
    v = kernel.vertices.tolist().index(vertices)
    found = tuple(kernel.arrays[name][:, v].sum(axis=0) for name in ("beta3", "beta3_reference"))
    if np.isnan(found[0]).any():
        raise SystemExit("kernels are not known: too many points are undecided, or pairs not run")
    return found


def mean_radius(n, volume):
    """Radius of the volume-mean floc, of numbers (times, classes)."""
    mean = (n * volume**2).sum(axis=1) / (n * volume).sum(axis=1)
    return (0.75 * mean / np.pi) ** (1.0 / 3.0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("results", help="file that flocsim kernel wrote")
    parser.add_argument("--vertices", type=int, help="N of the shapes (default: the largest)")
    parser.add_argument("--fraction", type=float, default=1e-6, help="volume of flocs per volume")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--figure", default="population_balance.png")
    args = parser.parse_args()
    kernel = flocsim.open(args.results).kernel
    if kernel is None:
        raise SystemExit(f"{args.results} is not from a kernel study")
    volume = 4.0 / 3.0 * np.pi * kernel.radii**3
    start = np.zeros(len(volume))
    start[0] = args.fraction / volume[0]
    times = np.linspace(0.0, 60.0 * args.minutes, 400)
    most = int(kernel.vertices.max()) if args.vertices is None else args.vertices
    found = [
        (label, grow(beta, volume, start, times))
        for label, beta in zip((f"flocs, N = {most}", "spheres, α = 1"), kernels(kernel, most),
                               strict=True)
    ]  # fmt: skip
    half = np.sqrt(kernel.radii[0] * kernel.radii[-1])
    for label, n in found:
        radius = mean_radius(n, volume)
        kept = (n[-1] @ volume) / (n[0] @ volume)
        reached = np.argmax(radius >= half)
        when = f"{times[reached] / 60:.0f} min" if radius[-1] >= half else "not reached"
        print(f"{label}: {1e6 * half:.3g} um after {when}; volume kept to {abs(kept - 1):.0e}")
    draw(found, times, kernel.radii, volume, args.figure)


def draw(found, times, radii, volume, path):
    """The mean size over time, and where the volume is at the end."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    # A column of a journal, 3.4 inches.
    plt.rcParams.update({"font.size": 7, "axes.linewidth": 0.6, "lines.linewidth": 1.0})
    figure, (left, right) = plt.subplots(1, 2, figsize=(3.4, 1.9), layout="constrained")
    colours = ("#0072B2", "#D55E00")
    middle = len(times) // 3
    for number, (label, n) in enumerate(found):
        left.plot(times / 60.0, 1e6 * mean_radius(n, volume), color=colours[number], label=label)
        share = n[middle] * volume / (n[middle] * volume).sum()
        places = np.arange(len(radii)) + 0.4 * (number - 0.5)
        right.bar(places, share, 0.38, color=colours[number])
    left.set_xlabel("time [min]")
    left.set_ylabel("volume-mean\nradius [µm]")
    figure.legend(frameon=False, loc="outside lower center", ncols=2)
    right.set_xticks(np.arange(len(radii)), [f"{1e6 * r:.3g}" for r in radii])
    right.set_xlabel("radius of size class [µm]")
    right.set_ylabel(f"fraction of volume\nafter {times[middle] / 60.0:.2g} min")
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_ylim(bottom=0.0)
    figure.savefig(path, dpi=400, metadata={"Software": None})
    print(path)


if __name__ == "__main__":
    main()
