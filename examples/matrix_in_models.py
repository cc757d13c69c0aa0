"""Matrices of flocsim in other models: FLOCMOD's balance, PySDM's super-particles, particula.

    flocsim kernel examples/kernel.toml
    flocsim export matrix kernel.h5 --what beta3                # kernels [m³/s]
    flocsim export matrix kernel.h5 --model flocmod              # what its own are multiplied by
    pip install PySDM particula                     # not needed by flocsim; flocmod needs neither
    python examples/matrix_in_models.py pysdm kernel-shear-N32-beta3.csv
    python examples/matrix_in_models.py particula kernel-shear-N32-beta3.csv
    python examples/matrix_in_models.py flocmod kernel-shear-N32-efficiency-flocmod.csv --shear 10

Each begins with flocs of the smallest class alone and prints how many there are over time, per m³.
"""

import argparse
import csv

import numpy as np
from population_balance import grow
from scipy.interpolate import RegularGridInterpolator


def read_matrix(path):
    """(radii (k,) [m], values (k, k)) of a matrix that flocsim export wrote."""
    with open(path, encoding="utf-8") as file:
        rows = [row for row in csv.reader(file) if not row[0].startswith("#")]
    values = np.array([[float(each or "nan") for each in row[1:]] for row in rows[1:]])
    if not np.isfinite(values).all():
        raise SystemExit(f"{path}: some pairs are not known, as where points are undecided")
    return np.array([float(each) for each in rows[0][1:]]), values


def between_classes(radii, values):
    """β(r_i, r_j) between the classes, linear in ln r; beyond them that of the nearest."""
    found = RegularGridInterpolator((np.log(radii), np.log(radii)), values)

    def beta(first, second):
        ends = (np.log(np.clip(each, radii[0], radii[-1])) for each in (first, second))
        return found(np.stack(np.broadcast_arrays(*ends), axis=-1))

    return beta


def flocmod(radii, efficiency, start, times, shear):
    """FLOCMOD's balance (Verney et al. 2011): f_coll_prob_sh = G (D_i + D_j)³/6, times the matrix;
    what two flocs become is shared between classes by mass, as there."""
    meet = shear / 6.0 * (2.0 * radii[:, None] + 2.0 * radii) ** 3
    first = np.where(np.arange(len(radii)) == 0, start, 0.0)
    return grow(meet * efficiency, 4.0 / 3.0 * np.pi * radii**3, first, times).sum(axis=1)


def pysdm(radii, values, start, times, super_particles=2**13):
    """Super-particles of PySDM in a box of 1 m³, their collision kernel that of the matrix."""
    from PySDM import Particulator
    from PySDM.backends import CPU
    from PySDM.dynamics import Coalescence
    from PySDM.environments import Box

    beta = between_classes(radii, values)

    class OfMatrix:
        """A collision kernel: β of the larger and the smaller of each pair."""

        def register(self, particulator):
            particulator.request_attribute("radius")
            self.particulator = particulator
            room = particulator.n_sd // 2
            self.large, self.small = (
                particulator.PairwiseStorage.empty(room, dtype=float) for _ in range(2)
            )

        def __call__(self, output, is_first_in_pair):
            radius = self.particulator.attributes["radius"]
            self.large.max(radius, is_first_in_pair)
            self.small.min(radius, is_first_in_pair)
            large, small = self.large.to_ndarray(), self.small.to_ndarray()
            pairs = (large > 0.0) & (small > 0.0)
            found = np.zeros(len(large))
            found[pairs] = beta(large[pairs], small[pairs])
            output.upload(found)

    step = times[1] - times[0]
    model = Particulator(
        super_particles,
        environment=Box(backend=CPU(), dt=step, dv=1.0),
        dynamics=[Coalescence(collision_kernel=OfMatrix(), adaptive=True)],
        attributes={
            "multiplicity": np.full(super_particles, round(start / super_particles)),
            "volume": np.full(super_particles, 4.0 / 3.0 * np.pi * radii[0] ** 3),
        },
    )
    numbers = []
    for _ in times:
        numbers.append(float(model.attributes["multiplicity"].to_ndarray().sum()))
        model.advance(1)
    return np.array(numbers)


def particula(radii, values, start, times, particles=2000):
    """Particles of particula in as small a volume as holds them, the kernel of its strategy that of
    the matrix."""
    import particula as par

    beta = between_classes(radii, values)

    class OfMatrix(par.dynamics.CoagulationStrategyABC):
        """A coagulation strategy: β of all pairs of radii."""

        def dimensionless_kernel(self, diffusive_knudsen, coulomb_potential_ratio):
            raise NotImplementedError("this kernel has its dimension")

        def kernel(self, particle, temperature, pressure):
            radius = particle.get_radius()
            return beta(radius[:, None], radius)

    volume, density = particles / start, 1000.0
    mass = density * 4.0 / 3.0 * np.pi * radii[0] ** 3
    flocs = par.particles.ParticleRepresentation(
        par.particles.ParticleResolvedSpeciatedMass(), par.particles.ActivityIdealMass(),
        par.particles.SurfaceStrategyVolume(), np.full(particles, mass), np.array(density),
        np.ones(particles), np.zeros(particles), volume,
    )  # fmt: skip
    strategy, step = OfMatrix("particle_resolved"), times[1] - times[0]
    numbers = []
    for _ in times:
        numbers.append(np.count_nonzero(flocs.get_mass() > 0.0) / volume)
        flocs = strategy.step(flocs, 293.15, 101325.0, step)
    return np.array(numbers)


MODELS = {"flocmod": flocmod, "pysdm": pysdm, "particula": particula}


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("model", choices=MODELS)
    parser.add_argument("matrix", help="file that flocsim export matrix wrote")
    parser.add_argument("--start", type=float, default=1e12, help="flocs per m³ at the start")
    parser.add_argument("--until", type=float, default=600.0, help="seconds")
    parser.add_argument("--shear", type=float, help="G [1/s], of flocmod")
    given = parser.parse_args()
    times = np.linspace(0.0, given.until, 61)
    more = {"shear": given.shear} if given.model == "flocmod" else {}
    numbers = MODELS[given.model](*read_matrix(given.matrix), given.start, times, **more)
    for time, number in zip(times[::10], numbers[::10], strict=True):
        print(f"{time:g} s: {number:.4g}")


if __name__ == "__main__":
    main()
