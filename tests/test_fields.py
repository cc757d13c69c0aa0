"""Quantities with units: exact, dimension checked, and nothing evaluated."""

import contextlib
import math
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flocsim.fields import KINDS, kind_of, read_quantity

EXACT = [
    ("16.41 um", "m", 16.41e-6),
    ("16.41 µm", "m", 16.41e-6),
    ("16.41 μm", "m", 16.41e-6),
    ("0.98 nm", "m", 0.98e-9),
    ("1.7 Å", "m", 1.7e-10),
    ("-15 mV", "V", -15e-3),
    ("+.5e3 s", "s", 500.0),
    ("1 eV", "J", 1.602176634e-19),
    ("0.89 mPa s", "Pa s", 0.89e-3),
    ("0.89 mPa·s", "Pa s", 0.89e-3),
    ("0.89 cP", "Pa s", 0.89e-3),
    ("2 kg/m^2", "kg/m^2", 2.0),
    ("2 kg m⁻²", "kg/m^2", 2.0),
    ("2.65 g/cm^3", "kg/m^3", 2650.0),
    ("2.65 g/cm³", "kg/m^3", 2650.0),
    ("9.81 m/s/s", "m/s^2", 9.81),
    ("1e6 1/s", "1/s", 1e6),
    ("5 Hz", "1/s", 5.0),
    ("90 1/min", "1/s", 1.5),
    ("3 Pa^0.5", "Pa^0.5", 3.0),
    ("1 um^0.5", "m^0.5", 1e-3),
    ("4 kPa um^-0.5", "Pa m-0.5", 4e6),
    ("4 mPa/um^(3/2)", "Pa/m^1.5", 4e6),
    ("4 kT@300K", "J", 4 * 300 * 1.380649e-23),
    ("4 k_BT@300K/nm^2", "N/m", 4 * 300 * 1.380649e-5),
    ("1e20/kT@300K", "1/J", 1e20 / (300 * 1.380649e-23)),
]


@pytest.mark.parametrize(("text", "unit", "value"), EXACT)
def test_conversion_is_exact(text, unit, value):
    assert read_quantity(text, unit) == value


@pytest.mark.parametrize("text", ["30 deg", "30 degrees", "30°", "30 °"])
def test_degrees(text):
    assert read_quantity(text, "rad") == pytest.approx(math.pi / 6, rel=1e-15)


@given(st.decimals(min_value=0, max_value=10**6, places=9))
def test_micrometres_equal_the_same_digits_shifted_by_six(number):
    assert read_quantity(f"{number:f} um", "m") == float(f"{number:f}e-6")


WRONG = {
    "3 kg": "",
    "5": "needs a unit",
    "um": "no number",
    "": "no number",
    "nan m": "no number",
    "1_000 m": "no unit",
    "5 furlangs": "unknown unit 'furlangs'",
    "0.95 px": "'px' is no unit of length: a pixel has the size that a picture has",
    "5 m +": "no unit",
    "9**9**9 m": "no unit",
    "1 m^99999999": "no unit",
    "1 None": "unknown unit",
    "1 degC": "",
    "1e9999 m": "no unit",
    "1 um^0.5": "",
    "1 m^(1/0)": "no unit",
    "4 kT": "kT needs its temperature, as in 'kT@298.15K'",
    "4 kT@293C": "kT needs its temperature",
    "4 kT@0K": "no unit",
    "4 kT@293K": "",
}


@pytest.mark.parametrize(("text", "reason"), WRONG.items())
def test_refused_with_a_reason(text, reason):
    with pytest.raises(ValueError) as caught:
        read_quantity(text, "m")
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.text(max_size=20), st.sampled_from(sorted(KINDS)))
def test_any_text_is_read_or_refused(text, unit):
    with contextlib.suppress(ValueError):
        assert isinstance(read_quantity("1 " + text, unit), float)


@pytest.mark.parametrize("unit", KINDS)
def test_the_example_of_a_kind_has_its_dimension(unit):
    example = KINDS[unit][1]
    assert math.isfinite(read_quantity(example, unit))
    assert example in kind_of(unit)


def test_pint_is_not_loaded_for_numbers():
    code = "import sys, flocsim.ensembles.config.loader; sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
