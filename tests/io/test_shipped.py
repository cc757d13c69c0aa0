"""The shape library that ships with flocsim."""

from pathlib import Path

import numpy as np
import pytest

from flocsim.ensembles.collision.flocs import load_flocs
from flocsim.errors import ConfigError
from flocsim.io.shape_library import SHIPPED, read_library
from tests.helpers.shipped_library import FLOCS, SIZES, VERTICES, entry
from tests.helpers.small_study import SMALL, load_text


def test_it_is_small_and_what_its_script_makes():
    assert SHIPPED.stat().st_size < 300_000
    found = read_library(SHIPPED)
    assert len(found) == FLOCS and all(tuple(each.fits) == VERTICES for each in found)
    sizes = [each.equivalent_radius * each.pixel_size for each in found]
    np.testing.assert_allclose(sizes, SIZES)
    for each in found:
        for n, fit in each.fits.items():
            size = each.equivalent_radius * each.pixel_size
            allowed = 0.06 if n >= 16 else 0.4
            assert fit.shape.equivalent_radius == pytest.approx(size, rel=allowed), n
        errors = [each.fits[n].relative_error for n in (4, 16, 64)]
        assert errors == sorted(errors, reverse=True) and errors[-1] < 25.0


@pytest.mark.slow
def test_a_floc_of_it_is_grown_and_fitted_again():
    made, kept = entry(3), read_library(SHIPPED)[3]
    assert made.floc_id == kept.floc_id
    assert made.fits[16].relative_error == pytest.approx(kept.fits[16].relative_error, rel=0.05)


def test_a_config_names_it_by_one_word(tmp_path):
    text = SMALL.replace("pool = 2", 'source = "library"\nfile = "synthetic"')
    config = load_text(tmp_path, text)
    assert len(load_flocs(config.shapes, 1)) == FLOCS
    with pytest.raises(ConfigError, match='or "synthetic", the one included in flocsim'):
        load_text(tmp_path, text.replace('"synthetic"', '"other.h5"'))


def test_a_library_of_the_users_own_of_that_name_comes_first(tmp_path):
    (tmp_path / "synthetic").write_bytes(SHIPPED.read_bytes())
    text = SMALL.replace("pool = 2", 'source = "library"\nfile = "synthetic"')
    assert Path(load_text(tmp_path, text).shapes.file) == tmp_path / "synthetic"
