"""Physical constants and numerical tolerances: each with its unit, source and reason."""

VACUUM_PERMITTIVITY = 8.854e-12
"""ε0 [F/m], rounded as the paper prints it (below eq. 6), so that its numbers come out."""

BOLTZMANN = 1.380649e-23
"""k_B [J/K], exact by definition."""

ELEMENTARY_CHARGE = 1.602176634e-19
"""e [C], exact by definition."""

AVOGADRO = 6.02214076e23
"""N_A [1/mol], exact by definition."""

ROOM_TEMPERATURE = 298.15
"""25 °C [K], where nothing else is said."""

STANDARD_GRAVITY = 9.81
"""g [m/s²], the value that MODEL's reference settling speeds were computed with."""

WATER_VISCOSITY = 8.9e-4
"""γ [Pa s] of water at 25 °C."""

WATER_DENSITY = 997.0
"""ρ_f [kg/m³] of water at 25 °C."""

WATER_PERMITTIVITY = 78.5
"""ε_r [-] of water at 25 °C (paper, below eq. 6)."""

MINIMUM_GAP = 1e-9
"""d_min [m]: the van der Waals law diverges at contact, below this gap it is held constant."""

DEEPEST_OVERLAP = 0.5
"""Largest overlap, as a share of r_i + r_j: past it the spring law has lost its meaning."""

NEGLIGIBLE_FORCE = 1e-9
"""A force weaker than this share of its greatest strength is out of reach and left out."""

CENTRE_SOFTENING = 1e-4
"""ε as a share of r_i + r_j: forces between centres see √(d_c² + ε²) for d_c, so that they fade out
where one floc lies nested around another's centre. At d_c = r_i + r_j that adds 5e-9 of it."""

LARGEST_BIAS = 0.03
"""Share by which the smooth gap of two outlines may change a surface force (rhs/surface_gap.py)."""

SHALLOWEST_TOUCH = 1e-12
"""[m], a hundredth of an atom: bodies that graze each other less deeply do not touch, and contact
points that are nearer to each other coincide. Scenes that graze by construction (δ = δ_max) would
otherwise hang on the rounding of their numbers."""

TINY = 1e-300
"""Takes the place of a divisor that is zero, so that a quotient stays finite."""
