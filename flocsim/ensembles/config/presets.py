"""Presets: values for keys that the user's config file does not give; the file overrides them.

- ``tang2014``: reproduces the paper's findings. Its Table 1, a mass per area of 2.0 kg/m² (a
  compromise between the masses that Table 1's damping implies), no buoyancy, and a Debye length
  of 0.98 µm, that of pure water. Attraction and repulsion then balance at 344 nm and 5925 nm; the
  outer root bounds the zone.
- ``tang2014-literal``: as printed, with a Debye length of 0.98 nm. Attraction exceeds repulsion at
  every distance, by more than 160 times, so that there is no zone: a run stops with an error. Give
  ``[zone]`` a distance or a centre to run it nevertheless.
- ``si``: solid particles of real weight. Quartz in water with buoyancy, forces between the
  outlines, a Debye length of 0.98 nm and a Hamaker constant of 4.7e-20 J. Here too there is no
  root (S = H_A κ/(24π ε0 ε_r φ²) = 4.1, above 4/e² = 0.54, the largest that has one), so the zone
  is given: d_0 = 10 nm. That is where the attraction H_A r*/(6 d²) of a Type I pair falls to the
  weight of its falling body (9.5 nm; Type II 6.2 nm, Type III 48 nm), and ten Debye lengths,
  where the repulsion has become negligible.
- ``clay``: flocs of mud in the sea, less dense the larger they are. Primary particles of 4 µm and
  2650 kg/m³, fractal dimension 2.1 (Verney et al. 2011, Cont. Shelf Res. 31, S64, who take 4 µm and
  1.9 to 2.1); water of 15 °C and 35 g/kg, whose viscosity, density, permittivity and Debye length
  follow (flocsim.water); a Hamaker constant of 2.0e-20 J, that of mica across water (Israelachvili
  2011, Intermolecular and Surface Forces, Table 13.3), and a potential of 15 mV, which corresponds
  to mobilities of 0.8e-8 m²/(V s) of particles in estuaries and the sea (Hunter and Liss 1982,
  Limnol. Oceanogr. 27, 322). Below 0.3 nm, about the size of a hydrated ion, the attraction no
  longer grows: in sea water the double layer is equally thin, and with a d_min of 1 nm repulsion
  would win at contact. No root here either; d_0 as in ``si``. In rivers mobilities are about twice
  as large: ``salinity = 0``, an ``ionic_strength`` of 1 to 5 mmol/l, 30 mV.
"""

from typing import Any

TANG2014: dict[str, Any] = {
    "bodies": {"surface_density": 2.0},
    "fluid": {"viscosity": 8.9e-4, "buoyancy": False},
    "forces": {
        "gravity": {},
        "drag": {},
        "van_der_waals": {"hamaker": 1e-18, "gap": "equivalent_spheres"},
        "double_layer": {
            "potential": 15e-3,
            "debye_length": 0.98e-6,
            "permittivity": 78.5,
            "gap": "equivalent_spheres",
        },
        "contact": {"k_n": 20.0, "k_t": 2.0, "damping_n": "critical", "damping_t": "proportional"},
    },
    "zone": {"root": "outer"},
}

TANG2014_LITERAL = TANG2014 | {
    "forces": TANG2014["forces"]
    | {"double_layer": TANG2014["forces"]["double_layer"] | {"debye_length": 0.98e-9}}
}

SI: dict[str, Any] = {
    "bodies": {"density": 2650.0, "depth": "sphere"},
    "fluid": {"viscosity": 8.9e-4, "density": 997.0, "buoyancy": True},
    "forces": {
        "gravity": {},
        "drag": {},
        "van_der_waals": {"hamaker": 4.7e-20, "gap": "surface"},
        "double_layer": {
            "potential": 15e-3,
            "debye_length": 0.98e-9,
            "permittivity": 78.5,
            "gap": "surface",
        },
        "contact": TANG2014["forces"]["contact"],
    },
    "zone": {"distance": 1e-8},
}

CLAY: dict[str, Any] = {
    "bodies": {
        "density": {"law": "fractal", "primary": 4e-6, "dimension": 2.1, "solid": 2650.0},
        "depth": "sphere",
    },
    "fluid": {"temperature": 288.15, "salinity": 35.0, "buoyancy": True},
    "forces": {
        "gravity": {},
        "drag": {},
        "van_der_waals": {"hamaker": 2e-20, "d_min": 3e-10, "gap": "surface"},
        "double_layer": {"potential": 15e-3, "gap": "surface"},
        "contact": TANG2014["forces"]["contact"],
    },
    "zone": {"distance": 1e-8},
}

PRESETS = {"tang2014": TANG2014, "tang2014-literal": TANG2014_LITERAL, "si": SI, "clay": CLAY}
"""Name → values, nested like the config file."""
